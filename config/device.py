"""Table `[device]` of the daemon: what it says of a device on any bus, and on Modbus.

`Device` is what a bus of another package builds on; `CanopenDevice` is in `config.canopen_device`.
"""

import math
from typing import Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from config.hosts import is_host
from config.loading import Many, Port, Schema
from config.modbus_map import SIMULATED_MAP, ModbusMap, words_of
from config.quantities import WRITABLE, ActionName
from config.serial_port import RtuUnit, SerialPort
from config.tls_table import Tls


def _host(host: str) -> str:
    if not is_host(host):
        raise ValueError("must be a host name or an IP address")
    return host


Host = Annotated[str, AfterValidator(_host)]
"""A host name or an IP address."""

RENAMED = {"untouched": "read_only", "clash": "conflict_with", "turn_s": "longest_exchange_s"}
"""Members of `Device` by the names they had in 0.1: a bus that still overrides one would be passed over in silence."""


RETRY_S, RETRY_SHARED_S = 1.0, 60.0
"""From one attempt to the next, where nobody says: alone on its line soon, for nobody is kept waiting."""


class Device(Schema):
    """What table `[device]` says of a device on any bus: a bus's own schema adds how to reach it."""

    bus: str
    retry_every_s: Annotated[float, Field(ge=0.01, le=86400)] | None = None
    """A device that does not answer is asked ever more seldom, in the end so often."""
    sampling: Literal["before", "after"] = "before"
    """What the pressure of a reply is: of the command before (latched, or on the device's own clock), or already of the
    one that the reply answers (sampled on request, after the write). A device in lockstep has obeyed for a period."""

    @classmethod
    def __pydantic_init_subclass__(cls, **_kwargs: Any) -> None:
        """Refuse a bus's own schema that overrides a member by its old name.

        Raises:
            TypeError: says what it is called now.
        """
        for old, new in RENAMED.items():
            if old in vars(cls):
                raise TypeError(f"{cls.__name__}.{old} is called {new} now")

    @property
    def line(self) -> str | None:
        """The line that only one may use at a time, if the device hangs on one; devices of one line take turns."""
        return None

    @property
    def on_shared_line(self) -> bool:
        """Whether asking this device when it does not answer keeps others waiting."""
        return False

    @property
    def longest_retry_s(self) -> float:
        """How often a device that does not answer is asked in the end; more seldom where that keeps others waiting."""
        return self.retry_every_s or (RETRY_SHARED_S if self.on_shared_line else RETRY_S)

    @property
    def longest_exchange_s(self) -> float:
        """The longest that one exchange may take: until a reply that does not come is given up."""
        return 0.0

    @property
    def acts_alone_after_s(self) -> float:
        """Silence after which the device acts by itself, where that is known."""
        return math.inf

    @property
    def acts_alone_by(self) -> ActionName | None:
        """What it is told to do then; None where it cannot be told."""
        return None

    @property
    def command_step_pa(self) -> float:
        """The least difference of two commands that the device is told; 0 where it is told any."""
        return 0.0

    @property
    def pressure_step_pa(self) -> float:
        """The least difference of two pressures that the device shows; 0 where it shows any, or none at all."""
        return 0.0

    def delivered_pa(self, command_pa: float) -> float:
        """Return the command nearest to one that the device can be told, Pa."""
        return command_pa

    def read_only(self) -> Self:
        """Return the same device as one who only watches wants it: opening it sets nothing in it."""
        return self

    def conflict_with(self, other: "Device") -> str | None:
        """Say what this valve's device and another's have in common that each must have for itself; None if nothing."""
        return "the same device" if self == other else None


class ModbusDevice(Device):
    """What table `[device]` says of a device on any Modbus."""

    reply_timeout_s: Annotated[float, Field(gt=0, le=60)] = 0.05
    communication_timeout_s: Annotated[float, Field(ge=0)] = 1.0
    communication_action: ActionName = "hold"
    write_functions: Many[Literal[23, 16, 6]] = (23, 16, 6)
    """Functions that it answers. One that it refuses is found out; one that it passes over in silence is not."""
    pause_s: Annotated[float, Field(ge=0, le=10)] = 0.0
    """What the device needs from its reply to the next request."""
    connect_pause_s: Annotated[float, Field(ge=0, le=60)] = 0.0
    """What it needs from being connected to, to the first request."""
    map: ModbusMap = SIMULATED_MAP

    @property
    def longest_exchange_s(self) -> float:
        """The reply's time-out, and the pause before the request."""
        return self.reply_timeout_s + self.pause_s

    @property
    def acts_alone_after_s(self) -> float:
        """The time-out that it is told, if it can be told one."""
        return self.communication_timeout_s or math.inf if self.map.communication_timeout_s else math.inf

    @property
    def acts_alone_by(self) -> ActionName | None:
        """The action that it is told, if it can be told one."""
        return self.communication_action if self.map.communication_action else None

    @property
    def command_step_pa(self) -> float:
        """The scale of its register, if that holds whole numbers."""
        place = self.map.command_pa
        return 0.0 if place.is_float else abs(place.scale)

    @property
    def pressure_step_pa(self) -> float:
        """The scale of its register, if that holds whole numbers."""
        place = self.map.pressure_pa
        return 0.0 if place is None or place.is_float else abs(place.scale)

    def delivered_pa(self, command_pa: float) -> float:
        """Return what its register can say."""
        place = self.map.command_pa
        return command_pa if place.is_float else place.value(place.raw(command_pa))

    def read_only(self) -> Self:
        """Return the device without the places of its communication time-out, which a watcher leaves alone."""
        places = self.map.model_copy(update={"communication_timeout_s": None, "communication_action": None})
        return self.model_copy(update={"map": places})

    @model_validator(mode="after")
    def _can_do_the_action(self) -> Self:
        codes = self.map.communication_action_codes
        if codes is not None and getattr(codes, self.communication_action) is None:
            raise ValueError(
                f"communication_action: {self.communication_action} has no number in map.communication_action_codes"
            )
        return self

    @model_validator(mode="after")
    def _can_be_written(self) -> Self:
        places = {name: each for name, each in self.map.places.items() if name in WRITABLE}
        one_by_one = next((name for name, each in places.items() if each.format.words > 1), None)
        if 16 not in self.write_functions and (one_by_one is not None or 6 not in self.write_functions):
            wanted, what = "16" if one_by_one else "16 or 6", one_by_one or "command_pa"
            raise ValueError(f"write_functions: map.{what} is written by {wanted}, which is missing")
        return self

    @model_validator(mode="after")
    def _timeout_survives_the_registers(self) -> Self:
        place = self.map.communication_timeout_s
        if place is None or self.communication_timeout_s == 0:
            return self
        raw = place.raw(self.communication_timeout_s)
        place.format.encode(raw)
        if place.value(raw) <= 0:  # a time-out that rounds to 0 would be none at all
            raise ValueError(
                f"communication_timeout_s: {self.communication_timeout_s} s becomes {place.value(raw):g} s "
                f"in the device's {place.type} of scale {place.scale:g}"
            )
        return self


class ModbusTcpDevice(ModbusDevice):
    """Table `[device]` of the daemon: a device on Modbus TCP."""

    bus: Literal["modbus"] = "modbus"
    host: Host = "127.0.0.1"
    port: Port = 5020
    unit: Annotated[int, Field(ge=0, le=255)] = 1
    framing: Literal["mbap", "rtu"] = "mbap"
    """"rtu": frames of a serial line, as a plain converter hands them through ("RTU over TCP")."""
    echoes_transaction: bool = True
    """Whether a reply has the number of its request; else whatever number comes is taken."""
    shared_line: bool | None = None
    """Whether a gateway to one serial line is at the address, which asks one device after another, and waits for each.
    Where nobody says: if another valve of this file has another unit there."""
    reply_unit: Annotated[int, Field(ge=0, le=255)] | None = None
    """The unit that replies say where it is another than the one that is asked."""
    tls: Tls | None = None
    """Modbus/TCP Security in place of Modbus TCP; its registered port is 802."""

    @property
    def on_shared_line(self) -> bool:
        """Whether it is behind a gateway that others need too."""
        return bool(self.shared_line)

    def is_beside(self, other: Device) -> bool:
        """Return whether another device is at the same address."""
        return isinstance(other, ModbusTcpDevice) and _at(self)[:2] == _at(other)[:2]

    def conflict_with(self, other: Device) -> str | None:
        """Say so if the other is the same device, however it is described."""
        same = isinstance(other, ModbusTcpDevice) and _at(self) == _at(other)
        return f"the same device, unit {self.unit} at {self.host}:{self.port}" if same else None


def _at(device: ModbusTcpDevice) -> tuple[str, int, int]:
    return device.host, device.port, device.unit


class ModbusRtuDevice(ModbusDevice):
    """Table `[device]` of the daemon: a device on a serial line, on Modbus RTU."""

    bus: Literal["rtu"] = "rtu"
    serial: SerialPort
    unit: RtuUnit = 1

    @property
    def line(self) -> str:
        """The serial line."""
        return self.serial.path

    def conflict_with(self, other: Device) -> str | None:
        """Say so if the other is the same device, or takes the same line for another kind."""
        if not isinstance(other, ModbusRtuDevice) or other.line != self.line:
            return None
        if other.unit == self.unit:
            return f"the same device, unit {self.unit} on {self.line}"
        return None if other.serial == self.serial else f"the line {self.line} with other characters"

    @property
    def longest_exchange_s(self) -> float:
        """Silence, the longest request (function 23: 13 bytes and the command), and the reply's time-out."""
        request = 13 + 2 * self.map.command_pa.format.words
        return self.serial.silence_s + request * self.serial.character_s + super().longest_exchange_s

    @model_validator(mode="after")
    def _a_reply_fits_into_its_timeout(self) -> Self:
        longest = max(map(words_of, self.map.runs))
        least_s = self.serial.silence_s + (2 * longest + 5) * self.serial.character_s
        if self.reply_timeout_s <= least_s:
            raise ValueError(
                f"reply_timeout_s must be more than {least_s:.4f} s, which a measurement takes "
                f"at {self.serial.baud} baud, it is {self.reply_timeout_s:g} s"
            )
        return self

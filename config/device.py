"""The device on the fieldbus: its quantities, declared once, and their place in Modbus registers.

`QUANTITIES` says what an I/P with a position transmitter offers. `SIMULATED_MAP` is where the simulated slave
keeps them; the map of a real device is written in the daemon's TOML file, in the same words.
"""

import math
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from config.hosts import is_host
from config.loading import Port, Schema
from config.register_format import Format, WireType, WordOrder
from config.serial_port import RtuUnit, SerialPort
from config.tls_table import Tls

MOST_REGISTERS = 125
"""A Modbus reply carries at most this many registers."""


class CommunicationAction(IntEnum):
    """What the device does by itself when nobody has commanded it for its communication time-out."""

    HOLD = 0
    VENT = 1
    FILL = 2


ActionName = Literal["hold", "vent", "fill"]


class DeviceStatus(IntFlag):
    """Bits of the device's status word; zero is healthy."""

    COMMUNICATION_LOST = 1
    SENSOR_FAULT = 2
    NOT_READY = 4


@dataclass(frozen=True, slots=True)
class Quantity:
    """One thing the device measures, counts or obeys."""

    name: str
    unit: str
    type: WireType
    writable: bool
    text: str


def _numbers(codes: type[IntEnum]) -> str:
    return ", ".join(f"{int(each)} {_words(each.name)}" for each in codes)


def _bits(flags: type[IntFlag]) -> str:
    return ", ".join(f"{each.bit_length() - 1} {_words(each.name)}" for each in flags)


def _words(name: str | None) -> str:
    return (name or "").lower().replace("_", " ")


QUANTITIES = (
    Quantity("position_m", "m", "float32", False, "stem position"),
    Quantity("pressure_pa", "Pa", "float32", False, "actuator pressure"),
    Quantity("sample_counter", "1", "uint32", False, "samples taken since power-up, wraps"),
    Quantity("device_time_us", "us", "uint64", False, "device's clock at the sample"),
    Quantity("status", "1", "uint16", False, f"bits: {_bits(DeviceStatus)}"),
    Quantity("command_pa", "Pa", "float32", True, "pressure command"),
    Quantity("communication_timeout_s", "s", "float32", True, "silence before the action; 0 is never"),
    Quantity("communication_action", "1", "uint16", True, _numbers(CommunicationAction)),
)

WRITABLE = frozenset(quantity.name for quantity in QUANTITIES if quantity.writable)
"""The names of the quantities that a master sets; the others are of the sample."""


class Place(Schema):
    """Where a quantity lies in a device's registers: value = scale * raw + offset, in the quantity's unit."""

    table: Literal["holding", "input"] = "holding"
    address: Annotated[int, Field(ge=0, le=65535)]
    type: WireType = "float32"
    word_order: WordOrder = "big"
    scale: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _has_a_scale_and_room(self) -> Self:
        if self.scale == 0:
            raise ValueError("scale must not be 0")
        if self.end > 65536:
            raise ValueError(f"{self.type} at {self.address} reaches past register 65535")
        return self

    @property
    def format(self) -> Format:
        """How the raw value lies in its registers."""
        return Format(self.type, self.word_order)

    @property
    def end(self) -> int:
        """The address just past the last register."""
        return self.address + self.format.words

    @property
    def is_plain(self) -> bool:
        """Whether the raw value is the value."""
        return self.scale == 1 and self.offset == 0

    def value(self, raw: float) -> float:
        """Return the value of a raw number."""
        return raw if self.is_plain else self.scale * raw + self.offset

    def raw(self, value: float) -> float:
        """Return the raw number nearest to a value; a whole one where the type is.

        Raises:
            ValueError: not a finite number.
        """
        if not math.isfinite(value):
            raise ValueError(f"{value} is not a finite number")
        raw = value if self.is_plain else (value - self.offset) / self.scale
        return raw if self.type in ("float32", "float64") else round(raw)


class ModbusMap(Schema):
    """The quantities a device has, by place. Only position and command are indispensable.

    What the device says of one sample (position, pressure, counter, time, status) is read in one transaction,
    so it must lie within 125 registers of one table.
    """

    position_m: Place
    command_pa: Place
    pressure_pa: Place | None = None
    sample_counter: Place | None = None
    device_time_us: Place | None = None
    status: Place | None = None
    communication_timeout_s: Place | None = None
    communication_action: Place | None = None

    @property
    def places(self) -> dict[str, Place]:
        """The quantities the device has, by name, in the order of `QUANTITIES`."""
        return {each.name: place for each in QUANTITIES if (place := getattr(self, each.name)) is not None}

    @property
    def sampled(self) -> dict[str, Place]:
        """The quantities of one sample, by name."""
        return {name: place for name, place in self.places.items() if name not in WRITABLE}

    @property
    def sampled_words(self) -> int:
        """Registers from the first to the last of one sample, those between its quantities included."""
        places = self.sampled.values()
        return max(place.end for place in places) - min(place.address for place in places)

    @model_validator(mode="after")
    def _can_be_read_and_written(self) -> Self:
        places = self.sampled.values()
        if len({place.table for place in places}) > 1:
            raise ValueError("position, pressure, counter, time and status must lie in one table")
        if self.sampled_words > MOST_REGISTERS:
            raise ValueError(f"one sample must lie within {MOST_REGISTERS} registers, it spans {self.sampled_words}")
        for name, place in self.places.items():
            if name in WRITABLE and place.table != "holding":
                raise ValueError(f"{name} is written, so it must lie in the holding table")
        return self

    @model_validator(mode="after")
    def _nothing_overlaps(self) -> Self:
        in_order = sorted(self.places.items(), key=lambda each: (each[1].table, each[1].address))
        for (name, place), (next_name, next_place) in pairwise(in_order):
            if place.table == next_place.table and place.end > next_place.address:
                raise ValueError(f"{name} and {next_name} share register {next_place.address}")
        return self


def _simulated_map() -> ModbusMap:
    """Lay the quantities one after another from register 0."""
    places, address = {}, 0
    for quantity in QUANTITIES:
        places[quantity.name] = Place(address=address, type=quantity.type)
        address = places[quantity.name].end
    return ModbusMap(**places)


SIMULATED_MAP = _simulated_map()


def _host(host: str) -> str:
    if not is_host(host):
        raise ValueError("must be a host name or an IP address")
    return host


class Device(Schema):
    """What table `[device]` says of a device on any bus: a bus's own schema adds how to reach it."""

    bus: str

    @property
    def line(self) -> str | None:
        """The line that only one may use at a time, if the device hangs on one; devices of one line take turns."""
        return None

    @property
    def turn_s(self) -> float:
        """The longest that it may keep others from the line: until a reply that does not come is given up."""
        return 0.0

    def untouched(self) -> Self:
        """Return the same device as one who only watches wants it: opening it sets nothing in it."""
        return self

    def clash(self, other: "Device") -> str | None:
        """Say what this valve's device and another's have in common that each must have for itself; None if nothing."""
        return "the same device" if self == other else None


class ModbusDevice(Device):
    """What table `[device]` says of a device on any Modbus."""

    reply_timeout_s: Annotated[float, Field(gt=0, le=60)] = 0.05
    communication_timeout_s: Annotated[float, Field(ge=0)] = 1.0
    communication_action: ActionName = "hold"
    map: ModbusMap = SIMULATED_MAP

    def untouched(self) -> Self:
        """Return the device without the places of its communication time-out, which a watcher leaves alone."""
        places = self.map.model_copy(update={"communication_timeout_s": None, "communication_action": None})
        return self.model_copy(update={"map": places})

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
    host: Annotated[str, AfterValidator(_host)] = "127.0.0.1"
    port: Port = 5020
    unit: Annotated[int, Field(ge=0, le=255)] = 1
    tls: Tls | None = None
    """Modbus/TCP Security in place of Modbus TCP; its registered port is 802."""

    def clash(self, other: Device) -> str | None:
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

    def clash(self, other: Device) -> str | None:
        """Say so if the other is the same device, or takes the same line for another kind."""
        if not isinstance(other, ModbusRtuDevice) or other.line != self.line:
            return None
        if other.unit == self.unit:
            return f"the same device, unit {self.unit} on {self.line}"
        return None if other.serial == self.serial else f"the line {self.line} with other characters"

    @property
    def turn_s(self) -> float:
        """Silence, the longest request (function 23: 13 bytes and the command), and the reply's time-out."""
        request = 13 + 2 * self.map.command_pa.format.words
        return self.serial.silence_s + request * self.serial.character_s + self.reply_timeout_s

    @model_validator(mode="after")
    def _a_reply_fits_into_its_timeout(self) -> Self:
        least_s = self.serial.silence_s + (2 * self.map.sampled_words + 5) * self.serial.character_s
        if self.reply_timeout_s <= least_s:
            raise ValueError(
                f"reply_timeout_s must be more than {least_s:.4f} s, which a measurement takes "
                f"at {self.serial.baud} baud, it is {self.reply_timeout_s:g} s"
            )
        return self

"""The device on the fieldbus: its quantities, declared once, and their place in Modbus registers.

`QUANTITIES` says what an I/P with a position transmitter offers. `SIMULATED_MAP` is where the simulated slave
keeps them; the map of a real device is written in the daemon's TOML file, in the same words.
"""

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from config.loading import Port, Positive, Schema
from config.wire import Format, WireType, WordOrder

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


QUANTITIES = (
    Quantity("position_m", "m", "float32", False, "stem position"),
    Quantity("pressure_pa", "Pa", "float32", False, "actuator pressure"),
    Quantity("sample_counter", "1", "uint32", False, "samples taken since power-up, wraps"),
    Quantity("device_time_us", "us", "uint64", False, "device's clock at the sample"),
    Quantity("status", "1", "uint16", False, "bits: 0 communication lost, 1 sensor fault, 2 not ready"),
    Quantity("command_pa", "Pa", "float32", True, "pressure command"),
    Quantity("communication_timeout_s", "s", "float32", True, "silence before the action; 0 is never"),
    Quantity("communication_action", "1", "uint16", True, "0 hold, 1 vent, 2 fill"),
)


class Place(Schema):
    """Where a quantity lies in a device's registers: value = scale * raw + offset, in the quantity's unit."""

    table: Literal["holding", "input"] = "holding"
    address: Annotated[int, Field(ge=0, le=65535)]
    type: WireType = "float32"
    word_order: WordOrder = "big"
    scale: float = 1.0
    offset: float = 0.0

    @model_validator(mode="after")
    def _scale_is_not_zero(self) -> Self:
        if self.scale == 0:
            raise ValueError("scale must not be 0")
        return self

    @property
    def format(self) -> Format:
        """How the raw value lies in its registers."""
        return Format(self.type, self.word_order)

    @property
    def end(self) -> int:
        """The address just past the last register."""
        return self.address + self.format.words


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
    def sampled(self) -> dict[str, Place]:
        """The quantities of one sample, by name."""
        names = ("position_m", "pressure_pa", "sample_counter", "device_time_us", "status")
        return {name: place for name in names if (place := getattr(self, name)) is not None}

    @model_validator(mode="after")
    def _can_be_read_and_written(self) -> Self:
        places = self.sampled.values()
        if len({place.table for place in places}) > 1:
            raise ValueError("position, pressure, counter, time and status must lie in one table")
        span = max(place.end for place in places) - min(place.address for place in places)
        if span > MOST_REGISTERS:
            raise ValueError(f"one sample must lie within {MOST_REGISTERS} registers, it spans {span}")
        for name in ("command_pa", "communication_timeout_s", "communication_action"):
            place = getattr(self, name)
            if place is not None and place.table != "holding":
                raise ValueError(f"{name} is written, so it must lie in the holding table")
        return self


def _simulated_map() -> ModbusMap:
    """Lay the quantities one after another from register 0."""
    places, address = {}, 0
    for quantity in QUANTITIES:
        places[quantity.name] = Place(address=address, type=quantity.type)
        address = places[quantity.name].end
    return ModbusMap(**places)


SIMULATED_MAP = _simulated_map()


class ModbusTcpDevice(Schema):
    """Table `[device]` of the daemon: a device on Modbus TCP."""

    bus: Literal["modbus"] = "modbus"
    host: str = "127.0.0.1"
    port: Port = 5020
    unit: Annotated[int, Field(ge=0, le=255)] = 1
    reply_timeout_s: Positive = 0.05
    communication_timeout_s: Annotated[float, Field(ge=0)] = 1.0
    communication_action: ActionName = "hold"
    map: ModbusMap = SIMULATED_MAP

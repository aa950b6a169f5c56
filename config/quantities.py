"""What an I/P with a position transmitter measures, counts and obeys: its quantities, declared once.

The Modbus map (`config.modbus_map`), the CANopen object dictionary (`config.canopen_device`) and its data sheet come
from `QUANTITIES`; texts of codes and bits are made from their enums.
"""

from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Literal

from config.register_format import WireType


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
    DEVICE_FAULT = 8


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


def list_bits(flags: type[IntFlag]) -> str:
    """Return `number name, number name, ...` of all bits."""
    return ", ".join(f"{each.bit_length() - 1} {_words(each.name)}" for each in flags)


def _words(name: str | None) -> str:
    return (name or "").lower().replace("_", " ")


QUANTITIES = (
    Quantity("position_m", "m", "float32", False, "stem position"),
    Quantity("pressure_pa", "Pa", "float32", False, "actuator pressure"),
    Quantity("sample_counter", "1", "uint32", False, "samples taken since power-up, wraps"),
    Quantity("device_time_us", "us", "uint64", False, "device's clock at the sample"),
    Quantity("status", "1", "uint16", False, f"bits: {list_bits(DeviceStatus)}"),
    Quantity("command_pa", "Pa", "float32", True, "pressure command"),
    Quantity("communication_timeout_s", "s", "float32", True, "silence before the action; 0 is never"),
    Quantity("communication_action", "1", "uint16", True, _numbers(CommunicationAction)),
)

WRITABLE = frozenset(quantity.name for quantity in QUANTITIES if quantity.writable)
"""The names of the quantities that a master sets; the others are of the sample."""

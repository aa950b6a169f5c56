"""The device as Modbus registers: its map read as one image, written by whole quantities.

The same map is served as holding and as input registers. A read takes one image of the device, so no value is torn;
registers between two quantities read 0. A measurement that its registers cannot hold saturates, as in any device; what
counts begins at 0 again. A write covers whole writable quantities, and all of it is checked before
any of it is obeyed.
"""

import math
import struct
from collections.abc import Callable, Sequence
from operator import attrgetter

from pymodbus.constants import ExcCodes

from config.modbus_map import SIMULATED_MAP, ModbusMap, Place
from config.quantities import WRITABLE, CommunicationAction
from fieldbus.modbus.function_codes import RegisterError, Table
from fieldbus.modbus.register_packing import layout
from sim.slave.clocks import Clock
from sim.slave.simulated_device import Device

COUNTED = frozenset({"sample_counter", "device_time_us"})


class DeviceRegisters:
    """Serves a device by its map.

    Args:
        device: the device.
        clock: lets its time pass.
        registers: where its quantities lie.
    """

    def __init__(self, device: Device, clock: Clock, registers: ModbusMap = SIMULATED_MAP) -> None:
        self._device = device
        self._clock = clock
        self._raw = [_raw_of(name, place, registers) for name, place in registers.places.items()]
        self._values = attrgetter(*registers.places)
        self._layout = layout(registers.places.values())
        self._words = struct.Struct(f">{self._layout.words}H")
        self._writable = {place.address: (name, place) for name, place in registers.places.items() if name in WRITABLE}

    def read(self, _table: Table, address: int, count: int) -> Sequence[int]:
        """Return words of one image of the device, brought up to date.

        Raises:
            RegisterError: ILLEGAL_ADDRESS, some lie outside the map; GATEWAY_NO_RESPONSE, it drops (`faults`).
        """
        self._require_answering()
        first = address - self._layout.address
        if not 0 <= first <= first + count <= self._layout.words:
            raise RegisterError(ExcCodes.ILLEGAL_ADDRESS)
        self._clock.catch_up()
        raw = [raw_of(value) for raw_of, value in zip(self._raw, self._values(self._device), strict=True)]
        return self._words.unpack(self._layout.pack(raw))[first : first + count]

    def write(self, address: int, words: Sequence[int], _peer: str) -> None:
        """Obey the quantities written, all or none.

        Raises:
            RegisterError: ILLEGAL_ADDRESS, not whole writable quantities; ILLEGAL_VALUE; GATEWAY_NO_RESPONSE.
        """
        self._require_answering()
        written = self._quantities(address, words)
        device = self._device
        try:
            timeout_s = written.get("communication_timeout_s", device.communication_timeout_s)
            action = CommunicationAction(int(written.get("communication_action", device.communication_action)))
            if "command_pa" in written:
                device.check(written["command_pa"])
            if len(written) > ("command_pa" in written):
                self._clock.catch_up()
                device.supervise(timeout_s, action)
            if "command_pa" in written:
                self._clock.command(written["command_pa"])
        except ValueError:
            raise RegisterError(ExcCodes.ILLEGAL_VALUE) from None

    def _require_answering(self) -> None:
        """Let a device that drops pass by the request: in lockstep a period goes by, or it would never answer again."""
        if self._device.drops:
            self._clock.idle()
            raise RegisterError(ExcCodes.GATEWAY_NO_RESPONSE)

    def _quantities(self, address: int, words: Sequence[int]) -> dict[str, float]:
        """Return the values written, by name."""
        values, at = {}, 0
        while at < len(words):
            if address + at not in self._writable:
                raise RegisterError(ExcCodes.ILLEGAL_ADDRESS)
            name, place = self._writable[address + at]
            end = at + place.format.words
            if end > len(words):
                raise RegisterError(ExcCodes.ILLEGAL_ADDRESS)
            values[name] = place.value(place.format.decode(words[at:end]))
            at = end
        return values


def _raw_of(name: str, place: Place, registers: ModbusMap) -> Callable[[float], float]:
    """Return what makes the raw number of a quantity's values."""
    if name in COUNTED and not place.is_float:
        counted = registers.sample_counter_range if name == "sample_counter" else 1 << 16 * place.format.words
        return lambda value: place.raw(value) % counted
    low, high = place.format.limits

    def measured(value: float) -> float:
        """A broken transmitter's NaN where the registers can say it, else 0."""
        if not math.isfinite(value):
            return value if place.is_float else 0
        return min(max(place.raw(value), low), high)

    return measured

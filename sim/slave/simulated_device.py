"""The I/P with its position transmitter as a device: what it measures, counts, obeys, and does by itself.

Pure logic on a grid of its own: sample n is taken at n T, T the period, and the command in force drives the valve
from one sample to the next. Who lets the time pass is told apart by who calls what:

    tick(command)    one period per command: lockstep and virtual time. Silence cannot happen, so it never trips.
    command, advance the master commands when it likes, the grid runs on: real time. After `communication_timeout_s`
                     without a command the device holds, vents or fills, and says so in its status until the next.

Attributes carry the names of `config.quantities.QUANTITIES`. What goes wrong with it by its file is judged at each
sample that it measures (`faults`); `drops` says whether it answers.
"""

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from config.quantities import CommunicationAction, DeviceStatus
from config.slave_file import DeviceFault, SlaveFile
from config.travel import Travel
from sim.parameter_changes import Changes
from sim.slave.faults import Faults
from sim.transmitter import Transmitter

HEALTHY = DeviceStatus(0)
LOST = DeviceStatus.COMMUNICATION_LOST
NEVER = 1 << 62
"""More periods than will ever pass."""


class Plant(Protocol):
    """What the device needs of a valve."""

    @property
    def pressure_pa(self) -> float:
        """The actuator pressure."""
        ...

    @property
    def position_m(self) -> float:
        """The true stem position."""
        ...

    @property
    def indicated_m(self) -> float:
        """The stem position as the linkage shows it, without noise."""
        ...

    def advance(self, command_pa: float, duration_s: float) -> None:
        """Let the valve obey a command for a while."""
        ...

    def change(self, **parameters: float) -> None:
        """Give parameters new values."""
        ...


class Device:
    """A simulated device; its position transmitter counts from the closed end (`config.travel`).

    Args:
        valve: the valve at rest, as it is when the device is switched on.
        file: period, sensor, supply, time-out, changes.
        parameters: the valve's base parameters by name, from which the changes start.

    Raises:
        InputError: the changes contradict each other.
    """

    def __init__(self, valve: Plant, file: SlaveFile, parameters: dict[str, float]) -> None:
        self._valve = valve
        self._period_s = file.clock.period_s
        self._period_us = file.clock.period_us
        # The limit as a float32 register can say it, so that "exactly the maximum" is not refused for its rounding.
        self._maximum_pa = max(file.supply.maximum_pa, float(np.float32(file.supply.maximum_pa)))
        self._transmitter = Transmitter(file.sensor)
        self._turned = Travel.of(parameters["stroke_m"], file.action) if file.action == "air_to_close" else None
        self._changes = Changes(file.change, parameters)
        self._file = file
        self._faults = Faults(file.fault)
        self._quiet_until_s = 0.0 if file.change else math.inf
        self._samples = self._shown = 0
        self._measured_s = 0.0
        self._supply_pa = math.inf
        self.position_m = self.pressure_pa = 0.0
        self.drops = False
        self.boot()
        self._measure()

    @property
    def stem_m(self) -> float:
        """The true stem position, which no bus serves: for judging what a positioner leaves."""
        return self._valve.position_m

    @property
    def samples(self) -> int:
        """How many periods have passed since it was switched on; does not wrap, and goes on over a restart."""
        return self._samples

    @property
    def sample_counter(self) -> int:
        """The number of the sample as 32 bits hold it."""
        return self._shown & 0xFFFFFFFF

    @property
    def device_time_us(self) -> int:
        """When the sample was taken, on the device's clock."""
        return self._shown * self._period_us

    def check(self, command_pa: float) -> None:
        """Refuse a command that the I/P cannot deliver.

        Raises:
            ValueError: it is not a number from 0 to the supply's maximum.
        """
        if not 0.0 <= command_pa <= self._maximum_pa:
            raise ValueError(f"command {command_pa} Pa is not within 0 to {self._maximum_pa:g} Pa")

    def command(self, command_pa: float) -> None:
        """Obey a pressure from now on.

        Raises:
            ValueError: as `check`; nothing changed.
        """
        self.check(command_pa)
        self.command_pa = command_pa
        self._last_heard = self._samples
        self.status = HEALTHY

    def tick(self, command_pa: float) -> None:
        """Obey a pressure for one period, then measure.

        Raises:
            ValueError: as `check`; nothing changed, no time passed.
        """
        self.command(command_pa)
        self._run(1)
        self._measure()

    def advance(self, periods: int) -> None:
        """Let periods pass, then measure. Acts by itself when it has heard nothing for its time-out."""
        left = periods
        while left > 0:
            stretch = min(left, self._until_lost())
            self._run(stretch)
            left -= stretch
            if self._until_lost() == 0:
                self._lose_communication()
        if periods > 0:
            self._measure()

    def stall(self, periods: int) -> None:
        """Let periods pass on the clock alone, the valve as it stands: the process was not running."""
        self._samples += periods

    def supervise(self, timeout_s: float, action: CommunicationAction) -> None:
        """Set what silence makes the device do; the silence starts anew, so that setting it moves nothing.

        Raises:
            ValueError: the time-out is negative or not a finite number; nothing changed.
        """
        if not (0.0 <= timeout_s < math.inf):
            raise ValueError(f"communication time-out {timeout_s} s is not a number from 0 up")
        self.communication_timeout_s = timeout_s
        self.communication_action = action
        self._last_heard = self._samples

    def suffer(self, fault: Mapping[str, object]) -> None:
        """Let something go wrong from now on, beside what its file says: a table `[[fault]]`.

        Raises:
            ValidationError: it is none.
        """
        self._faults = Faults((*self._file.fault, DeviceFault.model_validate(fault)))

    def change_valve(self, **parameters: float) -> None:
        """Give parameters of the valve new values at once."""
        self._valve.change(**parameters)

    def boot(self) -> None:
        """Begin with the settings of the file."""
        self._started = self._last_heard = self._samples
        self.status = HEALTHY
        self.command_pa = self._file.initial.pressure_pa
        self.communication_timeout_s = self._file.communication.timeout_s
        self.communication_action = CommunicationAction[self._file.communication.action.upper()]

    def _until_lost(self) -> int:
        """Return in how many periods the silence will have been too long; 0 is now."""
        if self.communication_timeout_s == 0 or self.status is LOST:
            return NEVER
        patience = math.ceil(self.communication_timeout_s / self._period_s)
        return max(0, self._last_heard + patience - self._samples)

    def _lose_communication(self) -> None:
        self.status = LOST
        match self.communication_action:
            case CommunicationAction.HOLD:
                pass
            case CommunicationAction.VENT:
                self.command_pa = 0.0
            case CommunicationAction.FILL:
                self.command_pa = self._maximum_pa

    def _run(self, periods: int) -> None:
        """Drive the valve; while parameters change, one period at a time."""
        left = periods
        while left > 0:
            now_s = self._samples * self._period_s
            if now_s >= self._quiet_until_s:
                self._valve.change(**self._changes.at(now_s))
                self._quiet_until_s = self._changes.quiet_until_s(now_s)
            stretch = left
            if self._quiet_until_s < now_s + left * self._period_s:
                stretch = max(1, min(left, math.ceil((self._quiet_until_s - now_s) / self._period_s)))
            self._valve.advance(min(self.command_pa, self._supply_pa), stretch * self._period_s)
            self._samples += stretch
            left -= stretch

    def _measure(self) -> None:
        now_s = self._samples * self._period_s
        found = self._faults.at(now_s, self._measured_s)
        self._measured_s = now_s
        self.drops, self._supply_pa = found.drops, found.supply_pa
        if found.restarts:
            self.boot()
        # The transmitter goes on in any case, so that a fault does not change the noise after it.
        indicated_m = self._valve.indicated_m
        position_m = self._transmitter.measure(
            indicated_m if self._turned is None else self._turned.turned_m(indicated_m)
        )
        if found.freezes:
            return
        self._shown = self._samples - self._started
        self.position_m = position_m + found.jump_m if found.jump_m else position_m
        self.pressure_pa = self._valve.pressure_pa
        if found.no_number:
            self.position_m = math.nan

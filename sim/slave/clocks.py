"""The slave's two clocks: who lets the device's time pass.

Lockstep: a command lets one period pass, a read none; the master's pace is the device's, and two runs are alike.
Real time: the device samples on its own grid, n = floor((now - start) / T); whoever asks first lets it catch up.
"""

import logging
import time
from collections.abc import Callable
from typing import Protocol

from config.slave_file import SlaveFile
from sim.slave.simulated_device import Device

log = logging.getLogger(__name__)

MOST_CATCH_UP_S = 1.0
"""If the process stood still for longer, the valve is not driven through the rest; the device's clock is right."""


class Clock(Protocol):
    """Lets the time of a device pass."""

    def catch_up(self) -> None:
        """Let the periods pass that are due by themselves."""
        ...

    def command(self, command_pa: float) -> None:
        """Give the device a command.

        Raises:
            ValueError: the device refuses it; nothing changed.
        """
        ...

    def idle(self) -> None:
        """Let the device pass by a command that is not for it: it goes on with its own."""
        ...


class Lockstep:
    """One period per command."""

    def __init__(self, device: Device) -> None:
        self._device = device

    def catch_up(self) -> None:
        """Do nothing: no time passes by itself."""

    def command(self, command_pa: float) -> None:
        """Let one period pass under a command."""
        self._device.tick(command_pa)

    def idle(self) -> None:
        """Let one period pass under the command in force."""
        self._device.tick(self._device.command_pa)


class RealTime:
    """The device's own grid, from now on.

    Args:
        device: the device; its period is the grid's.
        period_us: the period.
        now_ns: the clock; a monotonic one.
    """

    def __init__(self, device: Device, period_us: int, now_ns: Callable[[], int] = time.monotonic_ns) -> None:
        self._device = device
        self._period_ns = 1000 * period_us
        self._most = max(1, round(MOST_CATCH_UP_S * 1e9 / self._period_ns))
        self._now_ns = now_ns
        self._start_ns = now_ns()

    def catch_up(self) -> None:
        """Let the periods pass that have gone by since the last time."""
        due = (self._now_ns() - self._start_ns) // self._period_ns - self._device.samples
        if due > self._most:
            stalled = due - self._most
            log.warning("stood still: the valve missed %.3f s", stalled * self._period_ns * 1e-9)
            self._device.stall(stalled)
            due = self._most
        self._device.advance(due)

    def command(self, command_pa: float) -> None:
        """Latch a command at the sample now due; it drives the valve from there on."""
        self.catch_up()
        self._device.command(command_pa)

    def idle(self) -> None:
        """Let the periods pass that are due; the silence goes on."""
        self.catch_up()


def clock_of(file: SlaveFile, device: Device) -> Clock:
    """Return the clock that a slave file asks for."""
    return Lockstep(device) if file.clock.mode == "lockstep" else RealTime(device, file.clock.period_us)

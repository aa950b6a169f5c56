"""When the next cycle begins: on absolute deadlines in real time, or at once with a device in lockstep.

asyncio's timers have a grain of 1 ms and miss a third of the periods of a 1 kHz loop; a thread that sleeps to
absolute deadlines misses about 0.2 %. Under SCHED_FIFO the last part of the wait is spun, which takes the wake-up
out of the jitter; without it spinning only makes the scheduler push the thread aside.
"""

import ctypes
import gc
import logging
import os
import sys
import time
from typing import Protocol

from positioner.daemon.logs import log_event

log = logging.getLogger(__name__)

FIFO_PRIORITY = 40
MOST_SPIN_S = 200e-6
SPIN_SHARE = 0.2
"""Of a period at the most: the kernel stalls a FIFO thread that takes 95 % of a core."""
SWITCH_S, LONGEST_SWITCH_S = 100e-6, 5e-3
"""How long another thread may keep the interpreter before it is asked to let a cycle run: so long for each thread that
cycles, at the most. Whoever waits asks so often: of a hundred threads that asked every 100 us the asking took more
than both processors of a gateway. A cycle of some 200 us that waits for the wire lets go by itself."""
SILENCE_S = 2e-3
"""A device in lockstep that does not answer is asked again after this."""

PR_SET_TIMERSLACK = 29
MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4


class Pace(Protocol):
    """Says when a cycle begins and what time it is."""

    @property
    def period_s(self) -> float | None:
        """How far cycles should be apart; None where the device says."""
        ...

    def prepare(self) -> None:
        """Make the calling thread, which is the cycle's, as punctual as can be. Called once, before it cycles."""
        ...

    def wait(self) -> int:
        """Return when the next cycle is due; how many periods were missed since the last."""
        ...

    def now_s(self, device_time_s: float | None) -> float:
        """Return the time of this cycle; `device_time_s` is that of its measurement, None without one."""
        ...

    def since_s(self, now_s: float) -> float:
        """Return how long ago a cycle was that began at `now_s`. Called by any thread."""
        ...

    def in_force_pa(self, sent_pa: float, decided_pa: float) -> float:
        """Return which command acts from a sample on: the one sent with it, or the one decided on it."""
        ...


class RealTimePace:
    """Absolute deadlines on the gateway's monotonic clock.

    Args:
        period_s: from one deadline to the next.
        phase_s: deadlines are whole periods on that clock, and this; None begins with the first call of `wait`.
        may_spin: whether the last part of the wait may be spun. Where several cycles run, each that spins keeps the
            interpreter from the others.
    """

    def __init__(self, period_s: float, phase_s: float | None = None, may_spin: bool = True) -> None:
        self.period_s = period_s
        self._phase_s = phase_s
        self._may_spin = may_spin
        self._spin_s = 0.0
        self._due_s: float | None = None

    def prepare(self) -> None:
        """Ask the system for priority; spin only with it."""
        if raise_priority() and self._may_spin:
            self._spin_s = min(MOST_SPIN_S, SPIN_SHARE * self.period_s)

    def wait(self) -> int:
        """Sleep, then spin, until the next deadline. A missed one is not made up for."""
        missed = self.next_due()
        due_s = self.due_s
        rest_s = due_s - self._spin_s - time.monotonic()
        if rest_s > 0:
            time.sleep(rest_s)
        while time.monotonic() < due_s:
            pass
        return missed

    @property
    def due_s(self) -> float:
        """When the next cycle begins, on the monotonic clock."""
        return self._due_s or 0.0

    def next_due(self) -> int:
        """Set the next deadline; return how many periods were missed since the last."""
        now_s = time.monotonic()
        if self._due_s is None:
            self._due_s = now_s if self._phase_s is None else now_s - (now_s - self._phase_s) % self.period_s
        due_s = self._due_s + self.period_s
        missed = 0
        if now_s > due_s:
            missed = int((now_s - due_s) / self.period_s)
            due_s += missed * self.period_s
        self._due_s = due_s
        return missed

    def now_s(self, device_time_s: float | None) -> float:  # noqa: ARG002 - ages are by the gateway's clock
        """Return the gateway's monotonic time."""
        return time.monotonic()

    def since_s(self, now_s: float) -> float:
        """Return how long ago that was."""
        return max(0.0, time.monotonic() - now_s)

    def in_force_pa(self, sent_pa: float, decided_pa: float) -> float:  # noqa: ARG002 - it leaves with the next exchange
        """Return the command that travelled with the sample: it acts until the next exchange."""
        return sent_pa


class DevicePace:
    """As fast as a device in lockstep answers; its clock is the time."""

    period_s = None

    def __init__(self) -> None:
        self._now_s = 0.0
        self._is_silent = False

    def prepare(self) -> None:
        """Need nothing."""

    def wait(self) -> int:
        """Return at once; after a while if the device does not answer: asking again leaves time to others."""
        if self._is_silent:
            time.sleep(SILENCE_S)
        return 0

    def now_s(self, device_time_s: float | None) -> float:
        """Return the device's time; it stands still while the device does not answer."""
        self._is_silent = device_time_s is None
        if device_time_s is not None:
            self._now_s = device_time_s
        return self._now_s

    def since_s(self, now_s: float) -> float:  # noqa: ARG002 - no time passes between two cycles
        """Return 0: the device's clock waits for the cycle."""
        return 0.0

    def in_force_pa(self, sent_pa: float, decided_pa: float) -> float:  # noqa: ARG002 - its period is over
        """Return the decided command: the device stands still until it gets it."""
        return decided_pa


def prepare_process(cycle_threads: int) -> None:
    """Make a process ready for so many threads that cycle, before they begin."""
    gc.collect()
    gc.freeze()
    sys.setswitchinterval(min(SWITCH_S * cycle_threads, LONGEST_SWITCH_S))
    libc = ctypes.CDLL(None, use_errno=True)
    locked = hasattr(libc, "mlockall") and libc.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0
    log_event(log, logging.INFO, "cycle threads", threads=cycle_threads, memory_locked=locked)


def raise_priority() -> bool:
    """Make the calling thread as punctual as the system permits; return whether it got SCHED_FIFO."""
    libc = ctypes.CDLL(None, use_errno=True)
    if hasattr(libc, "prctl"):  # Linux
        libc.prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0)
    fifo = _take_fifo(FIFO_PRIORITY)
    log_event(log, logging.INFO, "cycle thread", fifo=fifo)
    return fifo


def raise_above_cycles() -> None:
    """Make the calling thread, which ends the daemon, more urgent than any that cycles: it ends when it is told to."""
    _take_fifo(FIFO_PRIORITY + 1)


def _take_fifo(priority: int) -> bool:
    if not hasattr(os, "sched_setscheduler"):  # macOS
        return False
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(priority))
    except OSError:
        return False
    return True

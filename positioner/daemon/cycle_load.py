"""What the cycles of a daemon's valves cost on this machine, measured before they are served, and how many fit.

    load = sum of c/T over the valves        c processor time of a cycle, T its period

An interpreter uses one processor, however many there are: a daemon whose cycles need more, or that has more lines than
`MOST_LINES`, shares its valves among processes, at most one a processor where its file says no number. c is that of the
daemon's own cycle on a device in memory, which answers at once, times `ON_THE_WIRE`.
"""

import logging
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

from config.daemon_file import DaemonFile
from config.errors import InputError
from drivers.in_memory import MemoryDriver
from positioner.control.controller import Controller
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.logs import log_event
from positioner.daemon.pacing import DevicePace

log = logging.getLogger(__name__)

ON_THE_WIRE = 4.0
"""Of the processor time in memory, that on a wire: frames, system calls, waiting for many descriptors at once.
`python -m benchmarks.many_valves` prints it: 4 to 5 beside few others on the same processors, 6 to 7 beside many."""
USABLE = 0.8
"""Of the processor: beyond it cycles wait for one another, and more than 1 % of the periods are missed."""
MOST_LINES = 100
"""Valves, or serial lines, of one process. A cycle costs the same in one of 200 as in two of 100 (314 and 356 us), but
its one thread is held up for all of them at once: beside others 88 of 200 were found stalled, and none in two
(`python -m benchmarks.many_valves --processes 1`)."""
IMPOSSIBLE = 2.0
"""Of the processor: no busy moment while it was measured makes so much of a load that fits."""
BATCHES, CYCLES = 6, 40
"""The least of so many means counts, each of so many cycles: others on the machine only make it more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CycleLoad:
    """What valves need of the processors.

    Attributes:
        valves: number of them that cycle in real time.
        fastest_s: the shortest period among them.
        cost_s: processor time of a cycle.
        share: of one processor; 1 is all of it.
        lines: number of valves, those of a serial line as one.
        processes: that may share them, each with a processor of its own.
    """

    valves: int
    fastest_s: float
    cost_s: float
    share: float
    lines: int = 1
    processes: int = 1

    @property
    def most(self) -> int:
        """How many such valves fit."""
        return int(USABLE * self.processes * self.valves / self.share) if self.share else self.valves

    @property
    def fits(self) -> bool:
        """Whether all do."""
        return self.share <= USABLE * self.processes

    @property
    def needed(self) -> int:
        """How many processes they need, of those that there may be."""
        return min(max(ceil(self.share / USABLE), ceil(self.lines / MOST_LINES), 1), self.processes)

    def require_that_it_fits(self, source: str) -> None:
        """Log a load that is more than there is.

        Raises:
            InputError: it is so much more that no busy moment explains it; the source is named.
        """
        if self.fits:
            return
        if self.share > IMPOSSIBLE * self.processes:
            raise InputError(source, self.said)
        log_event(log, logging.WARNING, "the valves need more than there is", load=self.said)

    @property
    def said(self) -> str:
        """All of it in a line; the key with which it is mended where they do not fit."""
        who = "1 valve needs" if self.valves == 1 else f"{self.valves} valves need"
        line = (
            f"{who} {100 * self.share:.0f} % of a processor, at {1e3 * self.fastest_s:g} ms and "
            f"{1e6 * self.cost_s:.0f} us a cycle; at most {self.most} fit on {self.processes}"
        )
        return line if self.fits else f"{line}: a longer cycle.period_s, or fewer valves"


def cycle_load(files: Sequence[DaemonFile], cost_s: float | None = None) -> CycleLoad | None:
    """Return the load of valves; None where none cycles in real time.

    Args:
        files: of each valve.
        cost_s: of a cycle; None: it is measured.
    """
    periods_s = [each.cycle.period_s for each in files if each.cycle.pace == "real_time"]
    if not periods_s:
        return None
    cost_s = cycle_cost_s(files[0]) if cost_s is None else cost_s
    share = sum(cost_s / each for each in periods_s)
    return CycleLoad(
        valves=len(periods_s),
        fastest_s=min(periods_s),
        cost_s=cost_s,
        share=share,
        lines=len({each.device.line or each.valve.name for each in files}),
        processes=min(files[0].service.processes or processors(), processors()),
    )


def processors() -> int:
    """Return how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def cycle_cost_s(file: DaemonFile) -> float:
    """Return the processor time that a cycle of a valve takes on this machine, s: it stands by, on its device's bus."""
    return ON_THE_WIRE * in_memory_s(file)


def in_memory_s(file: DaemonFile) -> float:
    """Return the processor time of a cycle on a device in memory, s."""
    pace = DevicePace()
    link = Link(MemoryDriver(AtRest(file.valve.stroke_m / 2, file.pressure.minimum_pa)), pace)
    held_pa, _ = link.open()
    cycle = Cycle(link, Controller(Settings.of(file), held_pa), pace, Requests(), None)
    means_s = []
    for _ in range(BATCHES):
        begun_s = time.thread_time()
        for _ in range(CYCLES):
            cycle.turn()
        means_s.append((time.thread_time() - begun_s) / CYCLES)
    return min(means_s)


class AtRest:
    """A device whose stem rests, but for the last digit of its sensor."""

    status = 0

    def __init__(self, position_m: float, pressure_pa: float) -> None:
        self._rest_m = self.position_m = position_m
        self.pressure_pa = self.command_pa = pressure_pa
        self.sample_counter = self.device_time_us = 0

    def tick(self, command_pa: float) -> None:
        """Take the next sample."""
        self.command_pa = self.pressure_pa = command_pa
        self.sample_counter += 1
        self.device_time_us += 10_000
        self.position_m = self._rest_m * (1.0 + 1e-5 * (self.sample_counter % 2))

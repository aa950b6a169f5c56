"""How punctual the cycle is: the last cycles' start times and durations, summed up only when somebody asks.

In real time also a histogram over all cycles, of how far the time from one cycle's start to the next's was from the
period that the daemon's file asks for.
"""

from bisect import bisect_left
from itertools import pairwise
from statistics import median

from config.registers import JITTER_BOUNDS_S

BOUNDS_S = tuple(JITTER_BOUNDS_S.values())
LENGTH = 1000
"""Cycles looked back on."""


class CycleStatistics:
    """Written by the cycle thread; read by others, who may see a cycle half entered and no harm in it.

    Args:
        period_s: that is asked for; None for a device in lockstep, which has no jitter.
    """

    def __init__(self, period_s: float | None = None) -> None:
        self._asked_s = period_s
        self._last_s: float | None = None
        self._off = [0] * len(BOUNDS_S)
        self.jitter_sum_us = 0
        self.cycles = 0
        self.missed_periods = 0
        self._started_s = [0.0] * LENGTH
        self._took_s = [0.0] * LENGTH

    def enter(self, started_s: float, took_s: float, missed: int) -> None:
        """Enter one cycle: when it began, how long it took, and how many periods were missed before it."""
        slot = self.cycles % LENGTH
        self._started_s[slot] = started_s
        self._took_s[slot] = took_s
        self.missed_periods += missed
        self.cycles += 1
        last_s, self._last_s = self._last_s, started_s
        if self._asked_s is not None and last_s is not None:
            off_s = abs(started_s - last_s - self._asked_s)
            self._off[bisect_left(BOUNDS_S, off_s)] += 1
            self.jitter_sum_us += round(off_s * 1e6)

    def periods_within(self, bound: int) -> int:
        """Return how many periods were off by at most the bound of that number among `JITTER_BOUNDS_S`."""
        return sum(self._off[: bound + 1])

    def period_s(self) -> float:
        """Return the median period; 0 before the second cycle."""
        return median(self._periods_s() or [0.0])

    def jitter_99_s(self) -> float:
        """Return how far from the median period 99 % of the periods stay."""
        periods_s = self._periods_s()
        if not periods_s:
            return 0.0
        middle_s = median(periods_s)
        return sorted(abs(period_s - middle_s) for period_s in periods_s)[int(0.99 * (len(periods_s) - 1))]

    def cycle_time_s(self) -> float:
        """Return the median time a cycle took."""
        return median(self._took_s[: self.cycles] or [0.0])

    def _periods_s(self) -> list[float]:
        cycles = self.cycles
        first = max(0, cycles - LENGTH + 1)  # the slot being written next may be torn
        started_s = [self._started_s[index % LENGTH] for index in range(first, cycles)]
        return [later - earlier for earlier, later in pairwise(started_s)]

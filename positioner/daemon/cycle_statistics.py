"""How punctual the cycle is: the last cycles' start times and durations, summed up only when somebody asks."""

from itertools import pairwise
from statistics import median

LENGTH = 1000
"""Cycles looked back on."""


class CycleStatistics:
    """Written by the cycle thread; read by others, who may see a cycle half entered and no harm in it."""

    def __init__(self) -> None:
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

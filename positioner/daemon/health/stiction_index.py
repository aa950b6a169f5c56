"""The stiction index: the part of the moves asked for that the stem did not make.

A move asked for is a change of the reference, in automatic, that then stands for a settling time. With x_0 where the
stem was at the change and r the reference, it was made if

    (x - x_0) / (r - x_0) >= 1/2    when the reference has stood for the settling time

A change before that takes the place of the one before: what the stem had not made by then is part of the new move.

Moves below the dead band of the travel accumulator are not judged: noise would answer for the stem. The index is the
mean over the first 20 moves, then forgets with a memory of 20 moves.
"""

from collections.abc import Callable
from math import isnan, nan

MEMORY = 20
"""Moves that the index remembers."""
MADE = 0.5


class StictionIndex:
    """Written by the cycle thread. Time by the clock of the cycle, s; lengths in m; `band_m` gives the dead band."""

    def __init__(self, settle_s: float, band_m: Callable[[], float]) -> None:
        self.index = 0.0
        self.judged = 0
        self.counted = (0, 0)
        """Moves judged, and missed, since the start; replaced whole."""
        self._settle_s = settle_s
        self._band_m = band_m
        self._reference_m = nan
        self._from_m = nan
        self._due_s = 0.0

    def enter(self, now_s: float, position_m: float, reference_m: float) -> None:
        """Take a good sample of a valve in automatic."""
        if reference_m != self._reference_m:
            first = isnan(self._reference_m)
            self._reference_m = reference_m
            if not first:
                self._asked(now_s, position_m)
        elif not isnan(self._from_m) and now_s >= self._due_s:
            self._judge(position_m)

    def interrupt(self) -> None:
        """Forget the move under way: the valve is not in automatic, or is being excited."""
        self._reference_m = self._from_m = nan

    def _asked(self, now_s: float, position_m: float) -> None:
        self._from_m = position_m
        self._due_s = now_s + self._settle_s

    def _judge(self, position_m: float) -> None:
        asked_m, went_m = self._reference_m - self._from_m, position_m - self._from_m
        self._from_m = nan
        if abs(asked_m) > self._band_m():
            self.judged += 1
            stuck = went_m / asked_m < MADE
            self.counted = (self.counted[0] + 1, self.counted[1] + stuck)
            self.index += (stuck - self.index) / min(self.judged, MEMORY)

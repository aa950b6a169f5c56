"""A characteristic through points that a person gives, straight between them.

Signals and openings both rise from point to point, so that each opening has one signal. Beyond the openings of the
first and the last point there is none: the nearest is taken.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Polygon:
    """By its points, (signal, opening), rising in both."""

    points: tuple[tuple[float, float], ...]

    def opening(self, signal: float) -> float:
        """Return h of a signal s, 0 to 1.

        >>> bent = Polygon(((0.0, 0.0), (0.5, 0.125), (1.0, 1.0)))
        >>> bent.opening(0.25), bent.signal(0.0625)
        (0.0625, 0.25)
        """
        return _through([each[0] for each in self.points], [each[1] for each in self.points], signal)

    def signal(self, opening: float) -> float:
        """Return s of an opening h, 0 to 1."""
        return _through([each[1] for each in self.points], [each[0] for each in self.points], opening)


def _through(xs: Sequence[float], ys: Sequence[float], x: float) -> float:
    """Return y at x on the straight lines through rising points; beyond the ends that of the nearest."""
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    after = bisect_right(xs, x)
    share = (x - xs[after - 1]) / (xs[after] - xs[after - 1])
    # Written so that no rounding leads beyond the ends of the line.
    return ys[after - 1] * (1.0 - share) + ys[after] * share

"""From the DCS's signal to the opening it asks for, and back: split range, then characteristic.

    s = (w - w_closed) / (w_open - w_closed)       held within 0 to 1
    h = s                                          linear
    h = (R^s - 1) / (R - 1)                        equal percentage, s = ln(1 + (R - 1) h) / ln R
    h = ln(1 + (R - 1) s) / ln R                   quick opening: the same backwards
    h on straight lines through points             polygon, which rises in both

w signal as written, s share of this valve's part of it, h opening, all 0 to 1; R rangeability. R^(s - 1), the inherent
characteristic of a trim, is 1/R at s = 0 and never shuts; equal percentage is the same curve moved so that it does.
w_open below w_closed: the valve opens as the signal falls.
"""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from math import log, log1p

from config.travel_table import TravelTable

Curve = Callable[[float], float]


@dataclass(frozen=True, slots=True)
class SignalPath:
    """The signals at which the valve is closed and open; the characteristic, and what undoes it; by default none."""

    closed: float = 0.0
    open: float = 1.0
    opening_of: Curve = float
    share_of: Curve = float

    @classmethod
    def of(cls, table: TravelTable) -> "SignalPath":
        """Return the path that table `[travel]` asks for."""
        return cls(*table.split_range, *_curves(table))

    def opening(self, signal: float) -> float:
        """Return the opening h that a signal w asks for, both 0 to 1."""
        return self.opening_of(min(max((signal - self.closed) / (self.open - self.closed), 0.0), 1.0))

    def signal(self, opening: float) -> float:
        """Return the signal w that asks for an opening h; of one beyond 0 to 1, that of the nearest end."""
        share = self.share_of(min(max(opening, 0.0), 1.0))
        return self.closed * (1.0 - share) + self.open * share


def _curves(table: TravelTable) -> tuple[Curve, Curve]:
    """Return h of s, and s of h."""
    steep, flat = partial(_power, table.rangeability), partial(_logarithm, table.rangeability)
    match table.characteristic:
        case "equal_percentage":
            return steep, flat
        case "quick_opening":
            return flat, steep
        case "polygon":
            signals, openings = zip(*table.polygon, strict=True)
            return partial(_through, signals, openings), partial(_through, openings, signals)
        case "linear":
            return float, float


def _power(rangeability: float, s: float) -> float:
    """Return h.

    >>> round(_power(49.0, 0.5), 12), round(_logarithm(49.0, 0.125), 12)
    (0.125, 0.5)
    """
    return float(rangeability**s - 1.0) / (rangeability - 1.0)


def _logarithm(rangeability: float, h: float) -> float:
    return min(log1p((rangeability - 1.0) * h) / log(rangeability), 1.0)


def _through(xs: Sequence[float], ys: Sequence[float], x: float) -> float:
    """Return y at x on the straight lines through rising points; beyond the ends that of the nearest.

    >>> _through((0.0, 0.5, 1.0), (0.0, 0.125, 1.0), 0.25)
    0.0625
    """
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    after = bisect_right(xs, x)
    share = (x - xs[after - 1]) / (xs[after] - xs[after - 1])
    # Written so that no rounding leads beyond the ends of the line.
    return ys[after - 1] * (1.0 - share) + ys[after] * share

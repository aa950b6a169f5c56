"""Was the sensor, or the valve, shifted while landings were gathered?

    p_j = κ x_j + φ_up + δ d_j,   p_j = κ x_j - φ_down + δ d_j       d_j = 0 before an instant, 1 after it

A position sensor that jumps shifts all that lands later by the same way, in either direction. The instant that parts
them best (`change_point.py`) is judged by t = |δ| / std δ.

A spring that hardens, or friction that grows over the travel, looks like a shift to a straight law, for S3 goes over
the travel in time. So where there are landings enough, a law bent by x^2 and s x must be parted by the shift as well.

An instant between all landings up and all landings down cannot be told from unlike friction: somebody has to land once
more in the first direction (the staircase does).
"""

from collections.abc import Iterable

import numpy as np

from positioner.estimation.array import Array
from positioner.estimation.landings.change_point import best_parting
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_law import DEVIATIONS, LEAST_SHIFT, columns, t_of_three_deviations

SURE = 2.0
"""Times three deviations, for the instant is sought, and a law that is bent looks like a small shift."""
FEWEST_BEND_LANDINGS = 10
"""Landings: fewer say nothing of a bend."""


def shifted(landings: Iterable[SlideOutcome], stroke_m: float) -> bool:
    """Return whether landings before and after some instant disagree.

    Args:
        landings: slides, in any order.
        stroke_m: full travel, m.
    """
    ordered = sorted(landings, key=lambda each: each.time_s)
    X, p = columns(ordered, stroke_m)
    if not _shift_in(X, p):
        return False
    share, way = X[:, 0], X[:, 1] + X[:, 2]
    bent = np.column_stack((X, share**2, way * share))
    return len(ordered) < FEWEST_BEND_LANDINGS or _shift_in(bent, p)


def _shift_in(X: Array, p: Array) -> bool:
    """Return whether some instant parts landings beyond what they scatter by, the law being that of X."""
    best = best_parting(X, p)
    if best is None:
        return False
    surely_pa = SURE * DEVIATIONS * t_of_three_deviations(best.free) * best.std_pa
    return abs(best.shift_pa) > max(surely_pa, LEAST_SHIFT * best.slope_pa)

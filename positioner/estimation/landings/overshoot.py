"""A stem that swings past its balance sticks there: how far past, as a share of its way.

From rest at x_0, and as long as it moves one way, a stem obeys a linear equation about its balance x_b. With a damping
ratio ζ < 1 it comes to v = 0 beyond it, and there static friction holds it, for k_s (x - x_b) < F_s + F_c:

    x = x_b + r (x_b - x_0),    r = exp(-π ζ/sqrt(1 - ζ^2)),    0 for ζ >= 1
    x_b = x - ρ (x - x_0),      ρ = r/(1 + r)

So its landings lie on the static law with their balances, and ρ is one more column of it, in n landings, X and p of
`static_law.columns`, positions in strokes:

    p_j = (X θ)_j - ν w_j + e_j,    w_j = (x_j - x_0,j)/stroke,    ρ = ν/(κ stroke)

Whether there is such a column: ρ > 6 of its deviations, and the residuals fall by a third. A slow pressure (a lag of
some 1/omega) leaves no swing.

A sensor that jumped looks like a swing where the ways before it were long, or where it came back and the jump counts as
a way. So there is none if without some one landing there is none, nor if an instant parts the landings
(`change_point.py`) and leaves less than two thirds of the residuals.
"""

from collections.abc import Sequence
from math import inf, sqrt

import numpy as np

from positioner.estimation.array import Array
from positioner.estimation.landings.change_point import FINEST, best_parting
from positioner.estimation.landings.landing_detector import SlideOutcome

FEWEST_SWING_LANDINGS = 8
"""Landings."""
DEVIATIONS = 6.0
FALL = 0.67
"""Of the residuals, at most, are left with the column."""
MOST = 0.5
"""r = 1: no damping at all."""
NONE = (0.0, 0.0)
"""A stem that does not swing."""


def swing_of(landings: Sequence[SlideOutcome], X: Array, p: Array, stroke_m: float) -> tuple[float, float]:
    """Return ρ and its standard deviation; 0, 0 where nothing shows that the stem swings.

    Args:
        landings: (n,), in the order of time, either way.
        X, p: their columns, (n, 3), and pressures, (n,), Pa.
        stroke_m: full travel.
    """
    if len(landings) < FEWEST_SWING_LANDINGS:
        return NONE
    ways = np.array([(each.position_m - each.from_m) / stroke_m for each in landings])
    rho, std, residual_pa = _swing(ways, X, p)
    if not rho:
        return NONE
    others = ~np.eye(ways.size, dtype=bool)
    if not all(_swing(ways[each], X[each], p[each])[0] for each in others):
        return NONE
    parting = best_parting(X, p)
    return NONE if parting and parting.residual_pa < FALL * residual_pa else (rho, std)


def _swing(ways: Array, X: Array, p: Array) -> tuple[float, float, float]:
    """Return ρ, its deviation, and that of the residuals, Pa; 0, 0 and infinite where there is no such column."""
    n = ways.size
    with_ways = np.column_stack((X, -ways))
    if np.linalg.matrix_rank(with_ways, tol=1e-3) < with_ways.shape[1]:
        return *NONE, inf
    without_pa = p - X @ np.linalg.lstsq(X, p)[0]
    theta = np.linalg.lstsq(with_ways, p)[0]
    left_pa = p - with_ways @ theta
    slope_pa = float(theta[0])
    s = max(sqrt(float(left_pa @ left_pa) / (n - 4)), FINEST * abs(slope_pa))
    std_pa = s * sqrt(float(np.linalg.inv(with_ways.T @ with_ways)[3, 3]))
    before = max(sqrt(float(without_pa @ without_pa) / (n - 3)), FINEST * abs(slope_pa))
    if slope_pa <= 0.0 or s > FALL * before or not DEVIATIONS * std_pa < theta[3] < MOST * slope_pa:
        return *NONE, inf
    return float(theta[3]) / slope_pa, std_pa / slope_pa, s


def balanced(landing: SlideOutcome, swing: float) -> SlideOutcome:
    """Return a landing with its balance, x_b, in place of where it sticks; swing is ρ."""
    if not swing:
        return landing
    return landing._replace(position_m=landing.position_m - swing * (landing.position_m - landing.from_m))

"""The instant that parts landings best: all that lie after it shifted by the same way.

    p_j = (X θ)_j + δ d_j + e_j       d_j = 0 before the instant, 1 after it;  n landings, the columns of X and d_j

Each instant between two landings that leaves the unknowns apart is tried; the least sum of squares is taken.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from positioner.estimation.array import Array

APART = 1e-3
"""Least singular value of what tells the unknowns apart."""
FINEST = 2e-4
"""Of the stroke: no law says better than this where a slide lands."""


class Parting(NamedTuple):
    """What the best instant leaves.

    Attributes:
        shift_pa: δ.
        std_pa: its standard deviation.
        slope_pa: κ times the stroke, without sign.
        residual_pa: s = max(sqrt(Σ e^2 / (n - columns - 1)), κ 2e-4 stroke).
        free: n - columns - 1.
    """

    shift_pa: float
    std_pa: float
    slope_pa: float
    residual_pa: float
    free: int


def best_parting(X: Array, p: Array) -> Parting | None:
    """Return what parts landings best; None where they are too few, or no instant can be told from their law.

    Args:
        X: columns of the law in the order of time, either way, the first of positions in strokes, (n, k).
        p: pressures, Pa, (n,).
    """
    count, known = X.shape
    free = count - known - 1
    if free < 1:
        return None
    least, best = np.inf, None
    for first in range(1, count):
        after = (np.arange(count) >= first).astype(float)
        with_shift = np.column_stack((X, after))
        if np.linalg.svd(with_shift, compute_uv=False)[-1] < APART:
            continue
        theta = np.linalg.lstsq(with_shift, p)[0]
        left = float(np.square(p - with_shift @ theta).sum())
        if left < least:
            slope_pa = abs(float(theta[0]))
            residual_pa = max(sqrt(left / free), FINEST * slope_pa)
            std = sqrt(float(np.linalg.inv(with_shift.T @ with_shift)[known, known]))
            least, best = left, Parting(float(theta[known]), residual_pa * std, slope_pa, residual_pa, free)
    return best

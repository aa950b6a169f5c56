"""The mean of what was seen nearby and of late, held back where that is little.

    m = Σ w_j y_j / (w_0 + Σ w_j)         w_j = exp(-z_j^2/2) ρ^j,  z_j how many widths y_j lies apart

The latest comes first.
"""

from collections.abc import Iterable
from math import exp


def mean_nearby(apart: Iterable[float], values: Iterable[float], fading: float, held_back: float) -> float:
    """Return m.

    Args:
        apart: z_j.
        values: y_j.
        fading: ρ.
        held_back: w_0.
    """
    weighted, weights, age = 0.0, held_back, 1.0
    for z, value in zip(apart, values, strict=True):
        weight = age * exp(-z * z / 2)
        weighted += weight * value
        weights += weight
        age *= fading
    return weighted / weights

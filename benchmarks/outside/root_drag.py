"""Drag that grows with the square root of the speed.

    F = -c sqrt(|v|) sign v

c drag at 1 m/s, N.
"""

from math import copysign, sqrt
from typing import Annotated, NamedTuple

from sim.effect import Parameter


class Parameters(NamedTuple):
    """c."""

    drag_n: Annotated[float, Parameter("drag at 1 m/s", 0.0, 1e6, off=0.0, starts=(0.2, 0.8), scale="coulomb_n")]


def force(v: float, q: Parameters) -> float:
    """Hold it back."""
    return -q.drag_n * copysign(sqrt(abs(v)), v)

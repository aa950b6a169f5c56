"""A detent: a force that alternates over the travel, as the teeth of a worn rack give.

    F = -F_t sin(2 pi x / w)

F_t amplitude, N; w pitch, m.
"""

from math import pi, sin
from typing import Annotated, NamedTuple

from sim.effect import Parameter


class Parameters(NamedTuple):
    """F_t, w."""

    force_n: Annotated[float, Parameter("amplitude", 0.0, 1e6, off=0.0, starts=(0.2, 0.6), scale="coulomb_n")]
    pitch_m: Annotated[float, Parameter("pitch", 1e-5, 10.0, starts=(0.2, 0.6), scale="stroke_m")]


def force(x: float, q: Parameters) -> float:
    """Push back and forth."""
    return -q.force_n * sin(2.0 * pi * x / q.pitch_m)

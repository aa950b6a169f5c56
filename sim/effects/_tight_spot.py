"""A tight spot: friction is higher about one position.

    F_c -> F_c + F_t exp(-((x - x_t) / w)^2),  F_s -> F_s + F_t exp(-((x - x_t) / w)^2)

F_t excess of friction in the middle of the spot, N; x_t where it is, m; w its half-width, m.
"""

from math import exp
from typing import Annotated, NamedTuple

from sim.effect import Parameter

LOOKS = "The stem hangs at one position, both ways, and jumps when it gets past."
CONFOUNDED = {"position_friction": "travel past the spot: behind it the friction is what it was before"}


class Parameters(NamedTuple):
    """F_t, x_t, w."""

    excess_n: Annotated[
        float,
        Parameter("excess in the middle", 0.0, 1e5, off=0.0, starts=(0.05, 0.2, 0.8), scale="coulomb_n"),
    ]
    position_m: Annotated[float, Parameter("where it is", -1.0, 1.0, starts=(0.2, 0.4, 0.6, 0.8), scale="stroke_m")]
    width_m: Annotated[float, Parameter("half-width", 1e-5, 1.0, starts=(0.02,), scale="stroke_m")]


def friction(F_c: float, F_s: float, x: float, q: Parameters) -> tuple[float, float]:
    """Raise both levels near the spot."""
    depth = (x - q.position_m) / q.width_m
    more = q.excess_n * exp(-depth * depth)
    return F_c + more, F_s + more

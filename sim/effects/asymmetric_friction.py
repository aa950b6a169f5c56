"""Friction that differs between opening and closing.

    F_c -> F_c (1 + e sigma),  F_s -> F_s (1 + e sigma)

e asymmetry, dimensionless; sigma = +1 opening, -1 closing: the mean of both directions stays the valve file's.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "sticks"
LOOKS = (
    "Break-away and sliding forces differ between opening and closing. Under a symmetric command in open loop "
    "the stem drifts one way."
)
CONFOUNDED = {
    "asymmetric_viscosity": "moves at several speeds both ways: a viscosity grows with the speed, this does not",
    "preload": "break-away and sliding levels in both directions: a preload shifts both by the same force, an "
    "asymmetry in proportion to each",
    "sensor_offset": "break-away and sliding levels in both directions: an offset shifts both by the same force, an "
    "asymmetry in proportion to each",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """e."""

    asymmetry: Annotated[
        float,
        Parameter(
            "half the difference over the mean, > 0: opening is harder",
            -0.9,
            0.9,
            off=0.0,
            starts=(-0.02, 0.02, -0.1, 0.1, -0.4, 0.4),
        ),
    ]


def friction(F_c: float, F_s: float, direction: float, q: Parameters) -> tuple[float, float]:
    """Scale both levels."""
    scale = 1.0 + q.asymmetry * direction
    return F_c * scale, F_s * scale

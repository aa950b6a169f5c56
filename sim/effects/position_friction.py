"""Friction that grows, or falls, over the stroke.

    F_c -> F_c (1 + g s),  F_s -> F_s (1 + g s),   s = x / L held within 0 and 1

g growth over the travel, dimensionless; L travel, m. One straight slope; a tight spot in the middle is not in it.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "sticks"
LOOKS = (
    "The opening and closing branches of the static curve part over the stroke: the dead band widens towards one end."
)
CONFOUNDED = {
    "pressure_power_friction": "the same position at different pressures: just before and just after a reversal",
    "pressure_friction": "the same position at different pressures: just before and just after a reversal",
    "friction_drift": "the same stretch of travel early and late in the record",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """g and L."""

    growth: Annotated[
        float,
        Parameter(
            "friction at full travel over friction at no travel, less 1",
            -0.9,
            20.0,
            off=0.0,
            starts=(-0.05, 0.05, -0.3, 0.3, 1.0),
        ),
    ]
    travel_m: Annotated[
        float, Parameter("travel over which it grows", 1e-4, 100.0, starts=(1.0,), scale="stroke_m", given=True)
    ]


def friction(F_c: float, F_s: float, x: float, q: Parameters) -> tuple[float, float]:
    """Scale both levels."""
    scale = 1.0 + q.growth * min(max(x / q.travel_m, 0.0), 1.0)
    return F_c * scale, F_s * scale

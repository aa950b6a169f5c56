"""Friction that grows with the actuator's pressure, which presses the seal on its surface.

    F_c -> F_c + mu p,  F_s -> F_s + mu p,   p >= 0

mu growth, N/Pa; p actuator pressure, Pa, gauge. A seal that loosens under pressure, mu < 0, is refused.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "sticks"
LOOKS = "The dead band widens with the pressure at which the stem works, at any speed."
CONFOUNDED = {
    "pressure_power_friction": "strokes at three pressures and more: the dead band's growth from each to the next",
    "position_friction": "the same position at different pressures: just before and just after a reversal",
    "friction_drift": "the same stretch of travel early and late in the record",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """mu."""

    growth_n_per_pa: Annotated[
        float,
        Parameter(
            "growth of both levels with pressure",
            0.0,
            1.0,
            off=0.0,
            starts=(0.005, 0.02, 0.06, 0.2),
            scale="diaphragm_area_m2",
        ),
    ]


def friction(F_c: float, F_s: float, p: float, q: Parameters) -> tuple[float, float]:
    """Raise both levels."""
    more = q.growth_n_per_pa * max(p, 0.0)
    return F_c + more, F_s + more

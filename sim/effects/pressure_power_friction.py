"""Friction that grows with a power of the actuator's pressure: a lip that is pressed on, and deforms.

    F_c -> F_c + F_1 (p / p_1)^n,  F_s -> F_s + F_1 (p / p_1)^n,   p >= 0

F_1 growth at p_1 = 100 kPa, N; p actuator pressure, Pa, gauge; n exponent, dimensionless: 1 is `pressure_friction`.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

P_1_PA = 1e5
AFTER = "pressure_friction"
COMPLAINT = "sticks"
LOOKS = (
    "The dead band widens with the pressure at which the stem works, at high pressures faster than at low ones, or "
    "slower."
)
CONFOUNDED = {
    "pressure_friction": "strokes at three pressures and more: the dead band's growth from each to the next",
    "position_friction": "the same position at different pressures: just before and just after a reversal",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """F_1 and n."""

    growth_n: Annotated[
        float,
        Parameter("growth of both levels at 100 kPa", 0.0, 1e6, off=0.0, starts=(0.02, 0.1, 0.4), scale="coulomb_n"),
    ]
    exponent: Annotated[float, Parameter("exponent of the growth", 0.25, 4.0, starts=(0.5, 1.5, 2.0, 3.0))]


def friction(F_c: float, F_s: float, p: float, q: Parameters) -> tuple[float, float]:
    """Raise both levels."""
    more = q.growth_n * (max(p, 0.0) / P_1_PA) ** q.exponent
    return F_c + more, F_s + more

"""Friction falls with speed a second time, over its own range of speeds.

    F_f(v) -> F_f(v) + F_x exp(-(|v| / v_x)^n)

F_x excess of friction at rest, N; v_x velocity over which it is lost, m/s; n shape, 2 as in the bare valve, 1 Tustin's.
It adds to the bare valve's Stribeck term: F_s grows by F_x. Static friction below Coulomb friction, F_x < 0, is
unphysical and refused: a fit that asks for it misses another effect.
"""

from math import exp
from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "sticks"
LOOKS = (
    "Stick-slip: break-away is late and the jump that follows long. Steady motion slower than v_x is rough or "
    "impossible; faster motion is untouched."
)
CONFOUNDED = {
    "static_n": "moves slow enough that the velocity stays about v_x: a ramp",
    "stribeck_velocity_m_per_s": "moves slow enough that the velocity stays about v_x: a ramp",
    "dwell_stiction": "holds of different lengths: this effect breaks away at the same force after each",
    "presliding": "small steps against a stuck stem: only presliding moves it",
}
INVERSE = "balance"
LOST = 40.0
"""|v| / v_x beyond which, for any n >= 1, less than 5e-18 of the excess is left; a power is dear."""


class Parameters(NamedTuple):
    """F_x, v_x, n."""

    excess_n: Annotated[
        float,
        Parameter(
            "friction at rest above that in fast motion, on top of the bare valve's",
            0.0,
            1e6,
            off=0.0,
            starts=(0.02, 0.05, 0.15, 0.5),
            scale="coulomb_n",
        ),
    ]
    velocity_m_per_s: Annotated[
        float,
        Parameter(
            "velocity over which it is lost", 1e-6, 100.0, starts=(1.0, 10.0, 100.0), scale="stribeck_velocity_m_per_s"
        ),
    ]
    exponent: Annotated[float, Parameter("shape", 1.0, 2.0, starts=(2.0,))]


def friction(F_c: float, F_s: float, v: float, q: Parameters) -> tuple[float, float]:
    """Raise both levels by what is left of the excess at v."""
    w = abs(v) / q.velocity_m_per_s
    if w > LOST:
        return F_c, F_s
    left = q.excess_n * exp(-(w**q.exponent))
    return F_c + left, F_s + left

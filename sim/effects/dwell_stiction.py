"""Static friction that grows while the stem rests.

    F_s -> F_s + F_d (1 - exp(-d / T))

F_d growth after a long rest, N; d time since the stem last moved, s; T time constant, s. The growth is lost as soon as
the stem has moved for a step. A valve that starts from rest has rested long.
"""

from math import exp
from typing import Annotated, NamedTuple

from sim.effect import Memory, Parameter

MEMORY = 1
STEP_S = 2e-3
LONG_AGO_S = -1e9
COMPLAINT = "sticks"
LOOKS = "The longer the hold, the later the break-away and the longer the jump; sliding is untouched."
CONFOUNDED = {
    "static_n": "holds of different lengths: static friction alone breaks away at the same force after each",
    "stribeck": "holds of different lengths: the Stribeck excess breaks away at the same force after each",
    "friction_drift": "holds of different lengths in mixed order: a drift goes with time, not with the hold",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """F_d and T."""

    growth_n: Annotated[
        float,
        Parameter("growth after a long rest", 0.0, 1e6, off=0.0, starts=(0.02, 0.05, 0.15, 0.5), scale="coulomb_n"),
    ]
    time_constant_s: Annotated[float, Parameter("time constant", 1e-3, 1e6, starts=(0.1, 0.5, 2.0, 5.0, 20.0))]


def start(t: float, z: Memory) -> None:
    """Rested long."""
    z[0] = t + LONG_AGO_S


def friction(F_c: float, F_s: float, t: float, q: Parameters, z: Memory) -> tuple[float, float]:
    """Raise the static level."""
    return F_c, F_s + q.growth_n * (1.0 - exp((z[0] - t) / q.time_constant_s))


def advance(t: float, v: float, z: Memory) -> None:
    """Note when it last moved."""
    if v != 0.0:
        z[0] = t

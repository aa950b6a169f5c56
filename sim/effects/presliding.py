"""Elastic motion of the stuck stem: the packing yields before it slips.

    stuck:  F_e(x) = F_h + k_p (x - x_h)        (x_h, F_h) where the stem was when it stuck

k_p presliding stiffness, N/m; F_e external force, N. The balance is quasi-static: a change dp of the pressure moves the
stuck stem by A dp / (k_s + k_p). Break-away is unchanged, |F_e| > F_s; a stem that sticks does not jump, since F_h is
the force found there. The creep is not counted as velocity. Each step solves the balance by Newton's method from the
last one.
"""

from math import inf
from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Memory, Parameter

MEMORY = 2
STEP_S = inf
HELD, BALANCED_N = 0, 1
"""Whether the packing holds the stem, and the force it balances, F_h + k_p (x - x_h)."""


COMPLAINT = "sticks"
LOOKS = (
    "Small steps move the stuck stem a little, in proportion, and back again, before break-away. After a slip it "
    "gives way when the pressure turns."
)
CONFOUNDED = {
    "presliding_hysteresis": "small cycles of the pressure below break-away: a loop only if energy is lost",
    "backlash": "restarts in the same direction after a hold: the packing yields again, the backlash is taken up",
    "stribeck": "small steps against a stuck stem: only presliding moves it",
    "quantisation": "small steps against a stuck stem: presliding follows each in proportion, a quantum not or wholly",
}


class Parameters(NamedTuple):
    """k_p."""

    stiffness_n_per_m: Annotated[
        float,
        Parameter(
            "presliding stiffness",
            1e-3,
            1e12,
            off=1e12,
            starts=(1e4, 3e3, 1e3, 3e2, 1e2),
            scale="coulomb_n / stroke_m",
        ),
    ]


def start(F_e: float, z: Memory) -> None:
    """Held as it stands."""
    z[HELD] = 1.0
    z[BALANCED_N] = F_e


def motion(F_e: float, stiffness: float, x: float, v: float, q: Parameters, z: Memory) -> tuple[float, float]:
    """Move the stuck stem to where its packing balances F_e."""
    if v != 0.0:
        z[HELD] = 0.0
        return x, v
    if z[HELD] == 0.0:
        z[HELD] = 1.0
        z[BALANCED_N] = F_e
    dx = (F_e - z[BALANCED_N]) / (stiffness + q.stiffness_n_per_m)
    z[BALANCED_N] += q.stiffness_n_per_m * dx
    return x + dx, v


def advance() -> None:
    """Do nothing: `motion` keeps the memory."""


def inverse(q: Parameters) -> Inverse:
    """Send a stem farther that yields before it breaks loose."""
    return Inverse(yielding_n_per_m=q.stiffness_n_per_m)

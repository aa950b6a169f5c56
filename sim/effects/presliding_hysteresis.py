"""Motion of the stuck stem with energy lost: the packing yields before it slips, and does not give all of it back.

    stuck:  dF/dx = k_p (1 - l s F / F_s)^n,    s = sign dx,    F = F_e(x)

F friction, N, in balance with the external force F_e; F_s break-away level, N; k_p presliding stiffness at F = 0, N/m;
l loss, n shape, dimensionless: at break-away the stiffness has fallen to (1 - l)^n of k_p, after a reversal there it
starts at (1 + l)^n of it, so that F over x is a loop. l = 1 is Dahl's model, in which a stem creeps and never breaks
away; l towards 0 is `presliding`. Between two forces F_0 and F_1

    x_1 - x_0 = s F_s / (l k_p) ((1 - l s F_1 / F_s)^(1 - n) - (1 - l s F_0 / F_s)^(1 - n)) / (n - 1)

(n = 1: s F_s / (l k_p) log of the brackets' ratio). Each step solves this with F_1 = F_e - K (x_1 - x_0), K the
stiffness -dF_e/dx, by Newton's method from F_e, from where it converges from one side. Break-away is unchanged,
|F_e| > F_s; a stem that sticks does not jump. The creep is not counted as velocity.
"""

from math import inf, log
from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Memory, Parameter

MEMORY = 3
STEP_S = inf
HELD, BALANCED_N, BREAKAWAY_N = 0, 1, 2
"""Whether the packing holds the stem, the force F it balances, and F_s as it was last asked for."""
NEWTON_STEPS = 8
SOLVED = 1e-9
"""Of F_s."""
LOGARITHMIC = 1e-6
"""Of n - 1."""

AFTER = "presliding"
COMPLAINT = "sticks"
LOOKS = (
    "Small steps move the stuck stem a little before break-away. Brought back to the same pressure it does not come "
    "back to the same place. Small cycles of the pressure draw loops."
)
CONFOUNDED = {
    "presliding": "small cycles of the pressure below break-away: a loop only if energy is lost",
    "backlash": "small cycles of growing height: a loop of the packing grows with them, a backlash has one width",
}


class Parameters(NamedTuple):
    """k_p, l, n."""

    stiffness_n_per_m: Annotated[
        float,
        Parameter(
            "presliding stiffness at no force",
            1e-3,
            1e12,
            off=1e12,
            starts=(1e4, 3e3, 1e3, 3e2),
            scale="coulomb_n / stroke_m",
        ),
    ]
    loss: Annotated[float, Parameter("loss: 0 none, 1 Dahl's", 0.01, 0.99, starts=(0.5, 0.9))]
    exponent: Annotated[float, Parameter("shape", 1.0, 4.0, starts=(1.0, 3.0))]


def start(F_e: float, z: Memory) -> None:
    """Held as it stands."""
    z[HELD] = 1.0
    z[BALANCED_N] = F_e


def friction(F_c: float, F_s: float, z: Memory) -> tuple[float, float]:
    """Take note of the break-away level."""
    z[BREAKAWAY_N] = F_s
    return F_c, F_s


def motion(F_e: float, stiffness: float, x: float, v: float, q: Parameters, z: Memory) -> tuple[float, float]:
    """Move the stuck stem to where its packing balances F_e."""
    if v != 0.0:
        z[HELD] = 0.0
        return x, v
    if z[HELD] == 0.0:
        z[HELD] = 1.0
        z[BALANCED_N] = F_e
    before, F_s = float(z[BALANCED_N]), float(z[BREAKAWAY_N])
    if F_e == before or F_s <= 0.0:
        return x, v
    s = 1.0 if F_e > before else -1.0
    first = bracket(s * before / F_s, q)
    balanced, dx = F_e, 0.0
    for _ in range(NEWTON_STEPS):
        here = bracket(s * balanced / F_s, q)
        dx = s * F_s / (q.loss * q.stiffness_n_per_m) * (integral(here, q) - integral(first, q))
        excess = balanced + stiffness * dx - F_e
        if abs(excess) <= SOLVED * F_s:
            break
        balanced -= excess / (1.0 + stiffness / (q.stiffness_n_per_m * here**q.exponent))
    z[BALANCED_N] = F_e - stiffness * dx
    return x + dx, v


def bracket(share: float, q: Parameters) -> float:
    """Return 1 - l s F / F_s of a share s F / F_s within -1 and 1."""
    return 1.0 - q.loss * min(max(share, -1.0), 1.0)


def integral(bracketed: float, q: Parameters) -> float:
    """Return what the way to a force is in proportion to."""
    m = q.exponent - 1.0
    return -log(bracketed) if m < LOGARITHMIC else bracketed**-m / m


def advance() -> None:
    """Do nothing: `motion` keeps the memory."""


def inverse(q: Parameters) -> Inverse:
    """Send a stem farther that yields before it breaks loose, by the mean stiffness between both break-aways."""
    way = (integral(1.0 - q.loss, q) - integral(1.0 + q.loss, q)) / q.loss
    return Inverse(yielding_n_per_m=q.stiffness_n_per_m * 2.0 / way)

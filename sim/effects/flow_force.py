"""Force of the flowing medium on the plug, growing with the opening.

    F = F_1 s^2,   s = x / L held within 0 and 1

F_1 force at full opening, N, positive towards opening; L travel, m. A part linear in x would be the spring rate over
again, a constant one a preload: neither could be told from those, so only the bending is in this effect.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "flow"
LOOKS = "The static curve bends one way over the whole travel, the same in fast moves and slow ones."
CONFOUNDED = {
    "spring_n_per_m": "the bending of the static curve alone: travel over the whole stroke",
    "spring_hardening": "travel to both ends: the flow force bends the curve evenly, the spring late",
    "area_variation": "fast moves, in which the pressure leaves the static curve",
    "sensor_nonlinearity": "the width of the dead band over the travel, which a bent sensor stretches and squeezes",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """F_1 and L."""

    force_n: Annotated[
        float,
        Parameter(
            "force at full opening, positive towards opening",
            -1e6,
            1e6,
            off=0.0,
            starts=(-0.01, 0.01, -0.05, 0.05, -0.2, 0.2),
            scale="spring_n_per_m * stroke_m",
        ),
    ]
    travel_m: Annotated[
        float, Parameter("travel from closed to open", 1e-4, 100.0, starts=(1.0,), scale="stroke_m", given=True)
    ]


def force(x: float, q: Parameters) -> float:
    """Push on the plug."""
    s = min(max(x / q.travel_m, 0.0), 1.0)
    return q.force_n * s * s

"""A bow of the sensor's characteristic: true at both ends of the travel, off in between.

    y = x + 4 b s (1 - s),   s = x / L held within 0 and 1

b bow in the middle, m; L travel, m; x position that enters, y position that leaves. A lever arm does it.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "lost calibration"
LOOKS = "The static curve is bent, both branches alike, and true at both ends."
CONFOUNDED = {
    "spring_hardening": "the width of the dead band over the travel, which a bent sensor stretches and squeezes",
    "flow_force": "the width of the dead band over the travel, which a bent sensor stretches and squeezes",
    "area_variation": "fast moves, in which the pressure leaves the static curve",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """b and L."""

    bow_m: Annotated[
        float,
        Parameter(
            "error in the middle",
            -1.0,
            1.0,
            off=0.0,
            starts=(-1e-3, 1e-3, -0.01, 0.01, -0.05, 0.05),
            scale="stroke_m",
        ),
    ]
    travel_m: Annotated[
        float, Parameter("travel between the true ends", 1e-4, 100.0, starts=(1.0,), scale="stroke_m", given=True)
    ]


def sensor(y: float, q: Parameters) -> float:
    """Bend it."""
    s = min(max(y / q.travel_m, 0.0), 1.0)
    return y + 4.0 * q.bow_m * s * (1.0 - s)

"""A spring whose rate grows with its deflection.

    F = -k_3 x^3

k_3 cubic rate, N/m^3; the spring's rate at x is k_s + 3 k_3 x^2. A softening spring, k_3 < 0, would run away: refused.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "spring or diaphragm"
LOOKS = "The static curve bends: the same step of pressure moves the stem less, the further it is open."
CONFOUNDED = {
    "flow_force": "travel to both ends: the spring bends the curve late, the flow force evenly",
    "area_variation": "fast moves, in which the pressure leaves the static curve",
    "sensor_nonlinearity": "the width of the dead band over the travel, which a bent sensor stretches and squeezes",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """k_3."""

    cubic_n_per_m3: Annotated[
        float,
        Parameter(
            "cubic rate",
            0.0,
            1e12,
            off=0.0,
            starts=(0.02, 0.05, 0.15, 0.5),
            scale="spring_n_per_m / stroke_m / stroke_m",
        ),
    ]


def force(x: float, q: Parameters) -> float:
    """Pull back, ever harder."""
    return -q.cubic_n_per_m3 * x * x * x

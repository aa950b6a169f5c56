"""Seat and upper stop: a stiff one-sided contact at each end of the travel.

    F = -max(0, k d + c d')        d depth beyond the stop, m;  it pushes back, never pulls

k contact stiffness, N/m; c contact damping, N s/m. Without this effect the travel is unlimited.
"""

from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Parameter

COMPLAINT = "play or stop"
LOOKS = "The stem halts at a position, always the same one, however far the command goes on, and leaves it late."
CONFOUNDED = {
    "supply_limit": "measured actuator pressure: the limit cuts it, a stop does not. Without it, another load: it "
    "shifts the place where a limit halts the stem, and not that of a stop",
}


class Parameters(NamedTuple):
    """The stops and their contact."""

    lower_m: Annotated[
        float,
        Parameter(
            "position of the lower stop", -100.0, 100.0, off=-100.0, starts=(0.0, 0.1), scale="stroke_m", guess="lowest"
        ),
    ]
    travel_m: Annotated[
        float,
        Parameter(
            "distance from the lower to the upper stop",
            1e-4,
            200.0,
            off=200.0,
            starts=(1.0, 0.9, 0.75, 0.5),
            scale="stroke_m",
            guess="swept",
        ),
    ]
    stiffness_n_per_m: Annotated[
        float, Parameter("contact stiffness", 1e5, 1e9, starts=(2000.0,), scale="spring_n_per_m")
    ]
    damping_ns_per_m: Annotated[
        float, Parameter("contact damping", 0.0, 1e5, starts=(16.0,), scale="viscous_ns_per_m", given=True)
    ]


def force(x: float, v: float, q: Parameters) -> float:
    """Push back into the travel."""
    below = q.lower_m - x
    above = x - (q.lower_m + q.travel_m)
    if below > 0.0:
        return max(0.0, q.stiffness_n_per_m * below - q.damping_ns_per_m * v)
    if above > 0.0:
        return -max(0.0, q.stiffness_n_per_m * above + q.damping_ns_per_m * v)
    return 0.0


def inverse(q: Parameters) -> Inverse:
    """Send the stem no farther."""
    return Inverse(lowest_m=q.lower_m, highest_m=q.lower_m + q.travel_m)

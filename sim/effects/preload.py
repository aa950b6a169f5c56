"""A constant force towards closing: the spring's preload, a weight, the medium on a closed plug.

    F = -F_0

F_0 preload, N, positive towards closing.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "spring or diaphragm"
LOOKS = "The whole curve of position over pressure is shifted, both branches by the same pressure F_0 / A."
CONFOUNDED = {
    "asymmetric_viscosity": "moves at several speeds both ways: a viscosity grows with the speed, this does not",
    "sensor_offset": "",
    "asymmetric_friction": "break-away and sliding levels in both directions: a preload shifts both by the same force, "
    "an asymmetry in proportion to each",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """F_0."""

    force_n: Annotated[
        float,
        Parameter(
            "force towards closing",
            -1e6,
            1e6,
            off=0.0,
            starts=(-0.02, 0.02, -0.1, 0.1, -0.5, 0.5),
            scale="coulomb_n",
        ),
    ]


def force(q: Parameters) -> float:
    """Push towards closing."""
    return -q.force_n

"""An indication whose span is off.

    y = g x

g gain, dimensionless; x position that enters, y position that leaves.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "lost calibration"
LOOKS = "Every move is indicated too long or too short by the same share."
CONFOUNDED = {"spring_n_per_m": ""}
INVERSE = "balance"


class Parameters(NamedTuple):
    """g."""

    gain: Annotated[float, Parameter("gain", 0.2, 5.0, off=1.0, starts=(0.995, 1.005, 0.97, 1.03, 0.85, 1.15))]


def sensor(y: float, q: Parameters) -> float:
    """Stretch it."""
    return q.gain * y

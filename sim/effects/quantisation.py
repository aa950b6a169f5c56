"""Rounding of the indication to the steps of a converter.

    y = q floor(x / q + 1/2)

q quantum, m; x position that enters, y position that leaves; q = 0 rounds nothing.
"""

from typing import Annotated, NamedTuple

import numpy as np

from config.extended_valve import Inverse
from sim.effect import Parameter

COMPLAINT = "lost calibration"
LOOKS = "The indication takes few values, all a multiple of q: a slow ramp looks like a staircase of equal stairs."
CONFOUNDED = {
    "static_n": "the heights of the stairs: the quantum's are all alike and stand at the same places, stick-slip's not",
    "backlash": "a slow ramp without a reversal: the quantum shows equal stairs, the backlash nothing",
    "presliding": "small steps against a stuck stem: presliding follows each in proportion, a quantum not or wholly",
}


class Parameters(NamedTuple):
    """q."""

    quantum_m: Annotated[
        float,
        Parameter("quantum", 0.0, 1.0, off=0.0, starts=(2.5e-4, 1e-3, 4e-3, 0.016), scale="stroke_m", guess="quantum"),
    ]


def sensor(y: float, q: Parameters) -> float:
    """Round it."""
    return float(q.quantum_m * np.floor(y / q.quantum_m + 0.5)) if q.quantum_m > 0.0 else y


def inverse(q: Parameters) -> Inverse:
    """Believe no difference smaller than a rounding; what it has rounded off is lost."""
    return Inverse(quantum_m=q.quantum_m)

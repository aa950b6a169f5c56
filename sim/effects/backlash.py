"""Backlash of the feedback linkage between stem and position sensor.

    y follows the stem only once the backlash is taken up: x - w/2 <= y <= x + w/2, else y stays

w width of the backlash, m; x position that enters, y position that leaves.
"""

from math import inf
from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Memory, Parameter

MEMORY = 1
STEP_S = inf


COMPLAINT = "play or stop"
LOOKS = "After every reversal the indication stays while the stem already moves; a slow cycle's branches part by w."
CONFOUNDED = {
    "presliding_hysteresis": "small cycles of growing height: a loop of the packing grows with them, a backlash has "
    "one width",
    "coulomb_n": "restarts in the same direction after a hold: friction holds again, the backlash is taken up already",
    "static_n": "restarts in the same direction after a hold: friction holds again, the backlash is taken up already",
    "presliding": "restarts in the same direction after a hold: the packing yields again, the backlash is taken up",
    "quantisation": "a slow ramp without a reversal: the backlash shows nothing, the quantum equal stairs",
}


class Parameters(NamedTuple):
    """w."""

    width_m: Annotated[
        float,
        Parameter("width of the backlash", 0.0, 1.0, off=0.0, starts=(5e-4, 2e-3, 0.01, 0.05), scale="stroke_m"),
    ]


def start(signal: float, z: Memory) -> None:
    """In the middle of the backlash."""
    z[0] = signal


def sensor(z: Memory) -> float:
    """Return y."""
    return float(z[0])


def advance(after: float, q: Parameters, z: Memory) -> None:
    """Take the linkage along."""
    z[0] = min(max(z[0], after - 0.5 * q.width_m), after + 0.5 * q.width_m)


def inverse(q: Parameters) -> Inverse:
    """Know on which side of the backlash the stem is."""
    return Inverse(play_m=q.width_m)

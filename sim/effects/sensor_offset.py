"""An indication that is off by a constant.

    y = x + b

b offset, m; x position that enters, y position that leaves.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "lost calibration"
LOOKS = "The whole record stands b too high; nothing else."
CONFOUNDED = {
    "preload": "",
    "asymmetric_friction": "break-away and sliding levels in both directions: an offset shifts both by the same force, "
    "an asymmetry in proportion to each",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """b."""

    offset_m: Annotated[
        float,
        Parameter("offset", -10.0, 10.0, off=0.0, starts=(-5e-4, 5e-4, -5e-3, 5e-3, -0.03, 0.03), scale="stroke_m"),
    ]


def sensor(y: float, q: Parameters) -> float:
    """Shift it."""
    return y + q.offset_m

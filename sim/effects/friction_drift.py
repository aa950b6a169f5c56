"""Friction that drifts with time: packing that warms, wears or dries.

    F_c -> F_c max(0, 1 + r t),  F_s -> F_s max(0, 1 + r t)

r drift, 1/s; t time from the start of the simulation, s. It is a straight line, for a record's length: over a day it
would pass every bound, where the slave file's changes are the means.
"""

from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Parameter

COMPLAINT = "drifts"
LOOKS = "The same command is answered with a wider (or narrower) dead band later in the record than at its start."
CONFOUNDED = {
    "dwell_stiction": "holds of different lengths in mixed order: a drift goes with time, not with the hold",
    "position_friction": "the same stretch of travel early and late in the record",
    "pressure_friction": "the same stretch of travel early and late in the record",
}


class Parameters(NamedTuple):
    """r."""

    rate_per_s: Annotated[
        float,
        Parameter(
            "drift of both levels, as a share per second",
            -1.0,
            1.0,
            off=0.0,
            starts=(-1e-3, 1e-3, -5e-3, 5e-3, -0.02, 0.02),
        ),
    ]


def friction(F_c: float, F_s: float, t: float, q: Parameters) -> tuple[float, float]:
    """Scale both levels."""
    scale = max(0.0, 1.0 + q.rate_per_s * t)
    return F_c * scale, F_s * scale


def inverse(q: Parameters) -> Inverse:
    """Follow it from landing to landing."""
    return Inverse(drift_per_s=q.rate_per_s)

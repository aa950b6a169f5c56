"""Viscous friction that is higher in one direction: a check valve in a damper, say.

    F = -|c| v   where c v > 0,   0 else

c what one direction has more, N s/m: > 0 opening, < 0 closing. It comes on top of the bare valve's F_v, which is that
of the other direction: neither is ever negative.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

AFTER = "asymmetric_friction"
COMPLAINT = "sticks"
LOOKS = "Fast moves are slower one way than the other, faster moves more so; slow ramps are the same both ways."
CONFOUNDED = {
    "asymmetric_friction": "moves at several speeds both ways: this grows with the speed, asymmetric friction does not",
    "preload": "moves at several speeds both ways: this grows with the speed, a constant force does not",
    "rate_limit": "measured actuator pressure: the limit lies before it, viscous friction after",
    "viscous_ns_per_m": "moves at several speeds both ways",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """c."""

    extra_ns_per_m: Annotated[
        float,
        Parameter(
            "excess in one direction, > 0: opening",
            -1e6,
            1e6,
            off=0.0,
            starts=(-0.1, 0.1, -0.4, 0.4, -1.5, 1.5),
            scale="viscous_ns_per_m",
        ),
    ]


def force(v: float, q: Parameters) -> float:
    """Hold it back one way."""
    return -abs(q.extra_ns_per_m) * v if q.extra_ns_per_m * v > 0.0 else 0.0

"""Drag that grows with the square of the velocity: oil in a damper, air through a port.

    F = -c v |v|

c drag, N s^2/m^2. Negative drag would drive the stem: refused.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "flow"
LOOKS = "High steps are slower than low steps suggest; slow ramps are untouched."
CONFOUNDED = {
    "viscous_ns_per_m": "moves at several speeds, from steps of different heights",
    "rate_limit": "measured actuator pressure: the limit lies before it, drag after",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """c."""

    drag_ns2_per_m2: Annotated[
        float, Parameter("drag", 0.0, 1e8, off=0.0, starts=(0.3, 1.0, 3.0, 10.0, 100.0), scale="viscous_ns_per_m")
    ]


def force(v: float, q: Parameters) -> float:
    """Hold it back."""
    return -q.drag_ns2_per_m2 * v * abs(v)

"""An effective diaphragm area that changes over the travel.

    A(x) = A + dA s,   s = x / L held within 0 and 1;   F = dA s p

dA change over the travel, m^2, negative where the area shrinks as it opens; L travel, m; p actuator pressure, Pa.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter

COMPLAINT = "spring or diaphragm"
LOOKS = "The static curve bends, more at higher pressure; in fast moves the force of one pascal varies with x."
CONFOUNDED = {
    "flow_force": "fast moves, in which the pressure leaves the static curve",
    "spring_hardening": "fast moves, in which the pressure leaves the static curve",
    "sensor_nonlinearity": "fast moves, in which the pressure leaves the static curve",
}
INVERSE = "balance"


class Parameters(NamedTuple):
    """dA and L."""

    change_m2: Annotated[
        float,
        Parameter(
            "area at full travel less area at no travel",
            -1.0,
            1.0,
            off=0.0,
            starts=(-0.01, 0.01, -0.05, 0.05, -0.2),
            scale="diaphragm_area_m2",
        ),
    ]
    travel_m: Annotated[
        float,
        Parameter("travel over which it changes", 1e-4, 100.0, starts=(1.0,), scale="stroke_m", given=True),
    ]


def force(x: float, p: float, q: Parameters) -> float:
    """Push as the additional area does."""
    return q.change_m2 * min(max(x / q.travel_m, 0.0), 1.0) * p

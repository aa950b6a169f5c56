"""A limited flow of air: the actuator fills and vents at a limited rate.

    p = u where that keeps   -r_v <= p' <= r_f,   else p goes towards u at the limit

r_f filling rate, r_v venting rate, Pa/s; u entering pressure, p leaving pressure, Pa. A step ends where p arrives at u;
where u itself moves, p is shown as the straight line with the same end and the same mean.
"""

from math import inf
from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Memory, Parameter

MEMORY = 1
STEP_S = inf
NO_TIME_S = 1e-9
"""In which p has arrived."""
UNLIMITED = 1e10
"""Pa/s, from which a jump is made at once."""
COMPLAINT = "air supply or leak"
LOOKS = (
    "High steps are answered by a ramp whose slope does not depend on the step's height. It differs between opening "
    "and closing if filling and venting do. Small steps are untouched."
)
CONFOUNDED = {
    "asymmetric_viscosity": "measured actuator pressure: the limit lies before it, viscous friction after",
    "ip_lag": "steps of different heights: the limit stretches the high ones, the lag none of them",
    "viscous_ns_per_m": "measured actuator pressure: the limit lies before it, viscous friction after",
    "quadratic_drag": "measured actuator pressure: the limit lies before it, drag after",
}


class Parameters(NamedTuple):
    """r_f and r_v."""

    filling_pa_per_s: Annotated[
        float,
        Parameter(
            "most rise of the pressure per second",
            1e-3,
            UNLIMITED,
            off=UNLIMITED,
            starts=(10.0, 3.0, 1.7, 1.0, 0.6, 0.3),
            scale="spring_n_per_m * stroke_m / diaphragm_area_m2",
        ),
    ]
    venting_pa_per_s: Annotated[
        float,
        Parameter(
            "most fall of the pressure per second",
            1e-3,
            UNLIMITED,
            off=UNLIMITED,
            starts=(10.0, 3.0, 1.7, 1.0, 0.6, 0.3),
            scale="spring_n_per_m * stroke_m / diaphragm_area_m2",
        ),
    ]


def start(signal: float, z: Memory) -> None:
    """Settled."""
    z[0] = signal


def straight(u: float, h: float, q: Parameters, z: Memory) -> float:
    """Until p is at u."""
    way = u - z[0]
    rate = q.filling_pa_per_s if way > 0.0 else q.venting_pa_per_s
    arrives_s = abs(way) / rate
    return float(arrives_s) if NO_TIME_S < arrives_s < h - NO_TIME_S and rate < UNLIMITED else h


def pressure(u: float, t: float, middle: float, q: Parameters, z: Memory) -> float:
    """Return p; at the start of a step that suffices to get to u, so much ahead that the mean is right."""
    h = 2.0 * (middle - t)
    way = u - z[0]
    rate = q.filling_pa_per_s if way > 0.0 else q.venting_pa_per_s
    if h <= 0.0 or abs(way) >= rate * h:
        return float(z[0])
    return u if rate >= UNLIMITED else float(u - way * abs(way) / (rate * h))


def advance(after: float, h: float, q: Parameters, z: Memory) -> None:
    """Follow u as fast as the air does."""
    z[0] = min(max(after, z[0] - q.venting_pa_per_s * h), z[0] + q.filling_pa_per_s * h)


def inverse(q: Parameters) -> Inverse:
    """Wait until p can have arrived."""
    return Inverse(filling_pa_per_s=q.filling_pa_per_s, venting_pa_per_s=q.venting_pa_per_s)

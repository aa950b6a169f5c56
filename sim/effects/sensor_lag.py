"""First-order lag of the position transmitter.

    T y' = x - y

T time constant, s; x position that enters, y position that leaves. Over a step h in which x goes straight from x_0 to
x_1, with r = (x_1 - x_0) / h, exactly: y_1 = x_1 - r T + (y_0 - x_0 + r T) exp(-h / T). At T = 0 it lets x through.
"""

from math import exp
from typing import Annotated, NamedTuple

from sim.effect import Memory, Parameter

MEMORY = 1
STEP_S = 5e-4
LOOKS = (
    "The indicated position rounds off every start and stop; after the stem has stuck it still creeps, exponentially, "
    "to its end."
)
CONFOUNDED = {
    "ip_lag": "measured actuator pressure; failing that, how abruptly a slip stops: the sensor's lag rounds it, the "
    "pressure's does not",
    "dead_time": "the first moments after break-away: the lag shows some of the motion at once",
}


class Parameters(NamedTuple):
    """T."""

    time_constant_s: Annotated[
        float, Parameter("time constant", 0.0, 60.0, off=0.0, starts=(0.003, 0.01, 0.03, 0.1, 0.5))
    ]


def start(signal: float, z: Memory) -> None:
    """Settled."""
    z[0] = signal


def sensor(y: float, q: Parameters, z: Memory) -> float:
    """Return the lagged position."""
    return float(z[0]) if q.time_constant_s > 0.0 else y


def advance(before: float, after: float, h: float, q: Parameters, z: Memory) -> None:
    """Carry it over the step."""
    T = q.time_constant_s
    if T > 0.0:
        ramp = (after - before) / h * T
        z[0] = after - ramp + (z[0] - before + ramp) * exp(-h / T)
    else:
        z[0] = after

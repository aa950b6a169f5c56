"""First-order lag of the position transmitter.

    T y' = x - y

T time constant, s; x position that enters, y position that leaves, m. Over a step in which x goes straight it is exact
(`sim.first_order_lag`). At T = 0 it lets x through.
"""

from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Memory, Parameter
from sim.first_order_lag import lagged

MEMORY = 1
STEP_S = 2e-3
COMPLAINT = "lost calibration"
LOOKS = (
    "The indication rounds off every start and stop. After the stem has stuck, the indication still creeps, "
    "exponentially, to its end."
)
CONFOUNDED = {
    "ip_lag": "measured actuator pressure; failing that, how abruptly a slip stops: the sensor's lag rounds it, the "
    "pressure's does not",
    "dead_time": "the first moments after break-away: the lag shows some of the motion at once",
}


class Parameters(NamedTuple):
    """T."""

    time_constant_s: Annotated[
        float, Parameter("time constant", 0.0, 60.0, off=0.0, starts=(0.003, 0.01, 0.03, 0.1, 0.5), guess="lag")
    ]


def start(signal: float, z: Memory) -> None:
    """Settled."""
    z[0] = signal


def sensor(y: float, q: Parameters, z: Memory) -> float:
    """Return the lagged position."""
    return float(z[0]) if q.time_constant_s > 0.0 else y


def advance(before: float, after: float, h: float, q: Parameters, z: Memory) -> None:
    """Carry it over the step."""
    z[0] = lagged(z[0], before, after, h, q.time_constant_s)


def inverse(q: Parameters) -> Inverse:
    """Wait until the indication can have come to rest."""
    return Inverse(sensor_lag_s=q.time_constant_s)

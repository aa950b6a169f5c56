"""First-order lag of the I/P converter, tubing and actuator volume.

    T p' = u - p

T time constant, s; u entering pressure, p leaving pressure, Pa. Over a step in which u goes straight it is exact
(`sim.first_order_lag`). At T = 0 it lets u through.
"""

from typing import Annotated, NamedTuple

from config.extended_valve import Inverse
from sim.effect import Memory, Parameter
from sim.first_order_lag import lagged

MEMORY = 1
STEP_S = 2e-3
COMPLAINT = "air supply or leak"
LOOKS = (
    "After a step of the command the stem starts late and gently, is fastest later and creeps into its end. The shape "
    "is the same whatever the step's height. On a ramp it runs T behind."
)
CONFOUNDED = {
    "dead_time": "the first moments after a step: the lag answers at once, the dead time not at all",
    "rate_limit": "steps of different heights: the lag stretches none of them, the limit the high ones",
    "sensor_lag": "measured actuator pressure: the lag lies before it, the sensor's after the stem",
}


class Parameters(NamedTuple):
    """T."""

    time_constant_s: Annotated[
        float, Parameter("time constant", 0.0, 60.0, off=0.0, starts=(0.005, 0.02, 0.05, 0.2, 1.0), guess="lag")
    ]


def start(signal: float, z: Memory) -> None:
    """Settled."""
    z[0] = signal


def pressure(u: float, q: Parameters, z: Memory) -> float:
    """Return p."""
    return float(z[0]) if q.time_constant_s > 0.0 else u


def advance(before: float, after: float, h: float, q: Parameters, z: Memory) -> None:
    """Carry p over the step."""
    z[0] = lagged(z[0], before, after, h, q.time_constant_s)


def inverse(q: Parameters) -> Inverse:
    """Lead against it."""
    return Inverse(lag_s=q.time_constant_s)

"""First-order lag of the I/P converter, tubing and actuator volume.

    T p' = u - p

T time constant, s; u entering pressure, p leaving pressure, Pa. Over a step h in which u goes straight from u_0 to u_1,
with r = (u_1 - u_0) / h, exactly: p_1 = u_1 - r T + (p_0 - u_0 + r T) exp(-h / T).
"""

from math import exp
from typing import Annotated, NamedTuple

from sim.effect import Memory, Parameter

MEMORY = 1


class Parameters(NamedTuple):
    """T."""

    time_constant_s: Annotated[float, Parameter("time constant", 1e-4, 60.0)]


def start(signal: float, z: Memory) -> None:
    """Settled."""
    z[0] = signal


def pressure(z: Memory) -> float:
    """Return p."""
    return float(z[0])


def advance(before: float, after: float, h: float, q: Parameters, z: Memory) -> None:
    """Carry p over the step."""
    ramp = (after - before) / h * q.time_constant_s
    z[0] = after - ramp + (z[0] - before + ramp) * exp(-h / q.time_constant_s)

"""Friction that remembers the last reversal: high after it, and lower the farther the stem has gone since.

    F_c -> F_c (1 + e / (1 + l / w)),  F_s the same,   l travel since the last reversal

e excess at a reversal, of both levels; w travel over which half of it is lost, m.
"""

from typing import Annotated, NamedTuple

from sim.effect import Memory, Parameter

MEMORY = 2
STEP_S = 1e-3


class Parameters(NamedTuple):
    """e, w."""

    excess: Annotated[float, Parameter("excess at a reversal", 0.0, 10.0, off=0.0, starts=(0.1, 0.4))]
    width_m: Annotated[float, Parameter("travel that halves it", 1e-5, 1.0, starts=(0.03, 0.2), scale="stroke_m")]


def start(x: float, z: Memory) -> None:
    """Turned where it stands."""
    z[0], z[1] = x, 0.0


def friction(F_c: float, F_s: float, direction: float, x: float, q: Parameters, z: Memory) -> tuple[float, float]:
    """Raise both levels after a reversal."""
    travel_m = abs(x - z[0]) if direction == z[1] else 0.0
    scale = 1.0 + q.excess / (1.0 + travel_m / q.width_m)
    return F_c * scale, F_s * scale


def advance(before: float, after: float, z: Memory) -> None:
    """Note where it turned."""
    if after != before:
        way = 1.0 if after > before else -1.0
        if way != z[1]:
            z[0], z[1] = before, way

"""A tight spot: friction is higher about one position, on flanks that fall like a parabola.

    F_c -> F_c + F_t max(0, 1 - ((x - x_t) / w)^2),  F_s the same

F_t excess in the middle, N; x_t where it is, m; w half-width, m.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter


class Parameters(NamedTuple):
    """F_t, x_t, w."""

    excess_n: Annotated[float, Parameter("excess", 0.0, 1e5, off=0.0, starts=(0.3, 1.0), scale="coulomb_n")]
    position_m: Annotated[float, Parameter("where it is", -1.0, 1.0, starts=(0.3, 0.7), scale="stroke_m")]
    width_m: Annotated[float, Parameter("half-width", 1e-5, 1.0, starts=(0.05, 0.1), scale="stroke_m")]


def friction(F_c: float, F_s: float, x: float, q: Parameters) -> tuple[float, float]:
    """Raise both levels near the spot."""
    depth = (x - q.position_m) / q.width_m
    more = q.excess_n * max(0.0, 1.0 - depth * depth)
    return F_c + more, F_s + more

"""A second spring that the stem meets on its way.

    F = -k_2 max(0, x - x_2)

k_2 its rate, N/m; x_2 where the stem meets it, m.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter


class Parameters(NamedTuple):
    """k_2, x_2."""

    rate_n_per_m: Annotated[float, Parameter("rate", 0.0, 1e8, off=0.0, starts=(0.1, 0.5), scale="spring_n_per_m")]
    position_m: Annotated[float, Parameter("where it is met", -1.0, 1.0, starts=(0.3, 0.6), scale="stroke_m")]


def force(x: float, q: Parameters) -> float:
    """Push back beyond the place."""
    return -q.rate_n_per_m * max(0.0, x - q.position_m)

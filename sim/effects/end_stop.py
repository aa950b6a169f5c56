"""Seat and upper stop: a stiff one-sided contact at each end of the travel.

    F = -max(0, k d + c d')        d depth beyond the stop, m;  it pushes back, never pulls

k contact stiffness, N/m; c contact damping, N s/m. Without this effect the travel is unlimited.
"""

from typing import Annotated, NamedTuple

from sim.effect import Parameter


class Parameters(NamedTuple):
    """The stops and their contact."""

    lower_m: Annotated[float, Parameter("position of the lower stop", -10.0, 10.0)]
    travel_m: Annotated[float, Parameter("distance from the lower to the upper stop", 1e-4, 10.0)]
    stiffness_n_per_m: Annotated[float, Parameter("contact stiffness", 1e5, 1e9)]
    damping_ns_per_m: Annotated[float, Parameter("contact damping", 0.0, 1e5)]


def force(x: float, v: float, q: Parameters) -> float:
    """Push back into the travel."""
    below = q.lower_m - x
    above = x - (q.lower_m + q.travel_m)
    if below > 0.0:
        return max(0.0, q.stiffness_n_per_m * below - q.damping_ns_per_m * v)
    if above > 0.0:
        return -max(0.0, q.stiffness_n_per_m * above + q.damping_ns_per_m * v)
    return 0.0

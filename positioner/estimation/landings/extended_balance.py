"""Is an extended valve the one that is there? What its landings say of it, and the straight law nearest to it.

What they say on top of its pressures: `local_balance.py`.
"""

from collections.abc import Iterable
from math import sqrt
from statistics import fmean

from config.extended_valve import ExtendedValve
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_law import StaticLaw

WORSE, LEAST_OFF = 2.0, 5e-3
"""Times as far off as off a straight law, and of the stroke: landings that scatter more are another valve's."""
FOLLOWED = 3
"""Numbers that landings give: a level in each direction, and what is left near a place."""


def contradicted(valve: ExtendedValve, law: StaticLaw) -> bool:
    """Whether landings say that this is another valve: they lie off its pressures, but not off a straight law.

    What is the same for all landings in a direction does not count: that is followed.
    """
    off_m = extended_scatter_m(valve, law.slides) if law.valid else 0.0
    return off_m > max(WORSE * law.residual_m, LEAST_OFF * valve.stroke_m)


def extended_scatter_m(valve: ExtendedValve, landings: Iterable[SlideOutcome]) -> float:
    """Return how far slides land off the valve's pressures, a standard deviation, m; levels that are followed apart."""
    off_pa: dict[int, list[float]] = {1: [], -1: []}
    for each in landings:
        off_pa[each.direction].append(each.command_pa - valve.landing_pa(each.position_m, each.direction))
    left_pa2 = sum((each - fmean(alike)) ** 2 for alike in off_pa.values() for each in alike)
    free = sum(map(len, off_pa.values())) - FOLLOWED
    return sqrt(left_pa2 / max(1, free)) / -straight_law(valve).b_over_c


def straight_law(valve: ExtendedValve) -> Ratios:
    """Return the straight law nearest to the valve's: its secant over the middle of the travel.

    For what wants a slope or a friction, not a pressure: dead bands, what S3 starts from.
    """
    low_m, high_m = 0.25 * valve.stroke_m, 0.75 * valve.stroke_m
    up, down = ([valve.landing_pa(x, s) for x in (low_m, high_m)] for s in (1, -1))
    slope = 0.5 * (up[1] - up[0] + down[1] - down[0]) / (high_m - low_m)
    up_pa, down_pa = (0.5 * sum(each) - slope * 0.5 * (low_m + high_m) for each in (up, down))
    return Ratios(-slope, -0.5 * (up_pa - down_pa), 0.5 * (up_pa + down_pa))

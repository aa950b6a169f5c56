"""The pressure that lands a slide at a position: that of the extended valve, and what the landings say on top of it.

    B(x, s) = p_s(x) + d_s + n_s(x)          p_s(x) of the extended valve (config/extended_valve.py)
    d_s     = mean of p_j - p_s(x_j)         over the latest landings in direction s: friction and spring that drift
    n_s(x)  = the same of what is left       over those near x, as of the straight law (local_balance.py)

Both means fade from landing to landing. The table has the shape; the landings keep its level true.
"""

from collections.abc import Iterable
from math import inf

from config.extended_valve import ExtendedValve
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.local_balance import WIDTH, missed_pa


def extended_landing_pa(stem_m: float, direction: int, valve: ExtendedValve, landings: Iterable[SlideOutcome]) -> float:
    """Return the pressure, Pa, under which a slide up (+1) or down (-1) lands at a position, m.

    Args:
        stem_m: where it is to land.
        direction: of the slide.
        valve: the extended valve.
        landings: the latest first; positions of the stem.
    """
    landed = [each for each in landings if each.direction == direction]
    drifted_pa = missed_pa(stem_m, landed, valve.landing_pa, inf)

    def followed_pa(position_m: float, direction: int) -> float:
        return valve.landing_pa(position_m, direction) + drifted_pa

    return followed_pa(stem_m, direction) + missed_pa(stem_m, landed, followed_pa, WIDTH * valve.stroke_m)


def straight_law(valve: ExtendedValve) -> Ratios:
    """Return the straight law nearest to the valve's: its secant over the middle of the travel.

    For what wants a slope or a friction, not a pressure: dead bands, what S3 starts from.
    """
    low_m, high_m = 0.25 * valve.stroke_m, 0.75 * valve.stroke_m
    up, down = ([valve.landing_pa(x, s) for x in (low_m, high_m)] for s in (1, -1))
    slope = 0.5 * (up[1] - up[0] + down[1] - down[0]) / (high_m - low_m)
    up_pa, down_pa = (0.5 * sum(each) - slope * 0.5 * (low_m + high_m) for each in (up, down))
    return Ratios(-slope, -0.5 * (up_pa - down_pa), 0.5 * (up_pa + down_pa))

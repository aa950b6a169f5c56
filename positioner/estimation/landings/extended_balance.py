"""The pressure that lands a slide at a position: that of the extended valve, and what the landings say on top of it.

    B(x, s) = p_s(x) + d_s + n_s(x)          p_s(x) of the extended valve (config/extended_valve.py)
    d_s     = mean of p_j - p_s(x_j)         over the latest landings in direction s: friction and spring that drift
    n_s(x)  = the same of what is left       over those near x, as of the straight law (local_balance.py)

with p_j + s r (t - t_j) (p_+(x_j) - p_-(x_j))/2 in place of p_j where friction is known to drift by r a second.

Both means fade from landing to landing; of a rounded indication only what is more than half a quantum counts. The table
has the shape; the landings keep its level true.
"""

from collections.abc import Callable, Iterable
from math import copysign, inf, sqrt
from statistics import fmean

from config.extended_valve import ExtendedValve
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.local_balance import FADING, HELD_BACK, WIDTH
from positioner.estimation.landings.mean_nearby import mean_nearby
from positioner.estimation.landings.static_law import StaticLaw

WORSE, LEAST_OFF = 2.0, 5e-3
"""Times as far off as off a straight law, and of the stroke: landings that scatter more are another valve's."""
FOLLOWED = 3
"""Numbers that landings give: a level in each direction, and what is left near a place."""
LARGEST_DRIFT = 0.1
"""Share of friction that a known drift is followed since a landing: a straight line goes on for no longer."""


def extended_landing_pa(
    stem_m: float, direction: int, valve: ExtendedValve, landings: Iterable[SlideOutcome], now_s: float
) -> float:
    """Return the pressure, Pa, under which a slide up (+1) or down (-1) lands at a position, m.

    Args:
        stem_m: where it is to land.
        direction: of the slide.
        valve: the extended valve.
        landings: the latest first; positions of the stem.
        now_s: time, as of the landings.
    """
    landed = [_today(each, valve, now_s) for each in landings if each.direction == direction]
    believed_pa = 0.5 * valve.inverse.quantum_m * -straight_law(valve).b_over_c
    drifted_pa = _missed_pa(stem_m, landed, valve.landing_pa, inf, believed_pa)

    def followed_pa(position_m: float, direction: int) -> float:
        return valve.landing_pa(position_m, direction) + drifted_pa

    return followed_pa(stem_m, direction) + _missed_pa(stem_m, landed, followed_pa, WIDTH * valve.stroke_m, believed_pa)


def _missed_pa(
    position_m: float,
    landed: Iterable[SlideOutcome],
    law: Callable[[float, int], float],
    width_m: float,
    least_pa: float,
) -> float:
    """Return by what a law misses landings near a position, Pa: the mean of e_j, weighted.

    Args:
        position_m: where.
        landed: all in one direction, the latest first.
        law: the pressure, Pa, at a position, m, in a direction.
        width_m: h.
        least_pa: by which each e_j is brought nearer to 0: less says nothing.
    """

    def missed(each: SlideOutcome) -> float:
        off_pa = each.command_pa - law(each.position_m, each.direction)
        return copysign(max(0.0, abs(off_pa) - least_pa), off_pa)

    near = [((each.position_m - position_m) / width_m, missed(each)) for each in landed]
    return mean_nearby((apart for apart, _ in near), (off_pa for _, off_pa in near), FADING, HELD_BACK)


def _today(each: SlideOutcome, valve: ExtendedValve, now_s: float) -> SlideOutcome:
    """Return a landing under the pressure that it would take now, its friction having drifted as is known."""
    share = valve.inverse.drift_per_s * (now_s - each.time_s)
    if share == 0.0:
        return each
    share = min(max(share, -LARGEST_DRIFT), LARGEST_DRIFT)
    friction_pa = 0.5 * (valve.landing_pa(each.position_m, 1) - valve.landing_pa(each.position_m, -1))
    return each._replace(command_pa=each.command_pa + each.direction * share * friction_pa)


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

"""Static friction from where the stem broke away: an event leaves an interval, and events together what they share.

F_s/A lies between the largest force under which the stem rested, l, and the one under which it left, h.
Evenly likely in between, it is (l + h)/2 with the standard deviation (h - l)/sqrt(12); so a value and its deviation say
the interval, value -+ sqrt(3) std. A mean of events would not do: pressures that always jump far beyond would
agree with each other, and on nothing that is true. Intervals that share nothing, as the friction or the sensors vary,
leave what lies between them.

Between two events the friction may have walked, as in `passive_identification`: the interval widens.
"""

from math import hypot, isfinite, sqrt

from config.codes import Refusal
from positioner.estimation.estimates import Estimate

WALK_PER_SQRT_S = 3e-3
"""Share of F_s by which it walks in a second, as the standard deviation."""


def from_interval(low_pa: float, high_pa: float, std_pa: float = 0.0) -> Estimate:
    """Return F_s/A, Pa, of an interval, Pa, whose ends are known to a standard deviation, Pa."""
    return Estimate((low_pa + high_pa) / 2, hypot((high_pa - low_pa) / sqrt(12), std_pa), Refusal.VALID)


def intersection(one: Estimate, other: Estimate) -> Estimate:
    """Return what two events leave: the intersection of their intervals, or what lies between them.

    >>> both = intersection(from_interval(20e3, 30e3), from_interval(26e3, 40e3))
    >>> round(both.value)
    28000
    """
    low = max(each.value - sqrt(3) * each.std for each in (one, other))
    high = min(each.value + sqrt(3) * each.std for each in (one, other))
    return from_interval(min(low, high), max(low, high))


def after_event(before: Estimate, event: Estimate, elapsed_s: float) -> Estimate:
    """Return what is known after an event, elapsed_s after what was known before; either may be no number (NaN)."""
    if not isfinite(before.value):
        return event
    aged = Estimate(before.value, hypot(before.std, WALK_PER_SQRT_S * before.value * sqrt(elapsed_s)), Refusal.VALID)
    return intersection(aged, event) if isfinite(event.value) else aged


def with_validity(estimate: Estimate, largest_relative_std: float) -> Estimate:
    """Return the estimate with its reason: valid or too uncertain."""
    if not isfinite(estimate.value):
        return estimate
    known = estimate.std <= largest_relative_std * estimate.value
    return Estimate(estimate.value, estimate.std, Refusal.VALID if known else Refusal.TOO_UNCERTAIN)

"""What is proved of the law on an identified valve: each move ends, in how many slides, and how far beyond it goes.

For every valve inside these intervals, from whatever it has taught, and for every reference that rests:

    β(x) in [lo, hi]       how far slides land off the straight law, at any place, in either direction
    abs(ε) <= S            how far one lands off another at the same place
    d in (held, broke]     break-away distance of a direction, going on or turning; over the travel within a factor Λ

A slide to r is sent by what landings have shown, c(r). The law keeps c between what the landings lay off by, and 0
(`local_balance`): c in [min(0, lo) - S, max(0, hi) + S] = [c_-, c_+], of width w. So however landings are bent, and
whatever is learnt elsewhere, the error of a landing is

    e' = β(r) - c(r) + ε,   abs(e') <= A + S = E           A = max(hi - c_-, c_+ - lo)

By w the law takes break-away for longer or shorter elsewhere: by at most Λ = (f + w/2)/(f - w/2) (1 + w/2h)/(1 - w/2h),
f = F_c/k_s, h the reach by which it takes a slope. That is the map in position. In direction: the four intervals of
break-away go on by what slides teach (`breakaway_distance`). What breaks loose is never shorter than held/Λ, and what
is surely longer than broke Λ + A breaks loose. So the law's own broke never falls below

    least = 0.95 (held/Λ - A)/Λ^2

and in a move each interval holds once at its likely way (a hold makes all others go as far as has broken loose), and
once at each of the ways  least, 1.3 least/Λ^2, 2.6 least/Λ^4, ...  that is shorter than broke Λ + A: n times. No way is
shorter than least over the root of 2, or of broke/held if that is more. Proved is

    the way back breaks loose             E <= (1.02 - 1) shortest + rounding
    a slide that lands is seen to do so   E <= 5 % of the shortest
    landings do not replace the law       max(-c_-, c_+) <= 0.2 % of stroke        (`StaticLaw.contradicts`)
    the move ends with landing L          E <= band 1.5^((L - 2)/2): L = 2, or 2 k + 1 where the band must widen
    N = L + 1 + 2 (n_on + n_turning)      at most as many as a move has, so that it never waits for more

The stem is never farther beyond its way than max(1.02 D_turning, D_on) + rounding + E, D the longest way so tried. What
cannot be proved is refused, with what would have to be known better. Where a bound of the site bars an excursion, or
makes it wait, a move waits. Not in it: a packing that gives way, a stem that swings, ramps, stops, and what moves the
stem beside the law.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil, inf, log, sqrt
from statistics import median

from positioner.control.laws.slides.plan import shortest_seen_m
from positioner.control.laws.slides.slide_bounds import THRESHOLDS, SlideBounds
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.estimation.landings.breakaway_distance import FADED, GROWS, RAISE, Interval
from positioner.estimation.landings.packing_compliance import compliance
from positioner.estimation.landings.static_law import LEAST_SHIFT

DEVIATIONS = 3.0
LEAST_SCATTER = 1e-5
"""Of the stroke: no slides repeat themselves better."""
FEWEST = 3
"""Landings in a direction from which their scatter is told."""
WIDEST = 4.0
"""broke over held: up to this the second try goes as far as has broken loose."""
DIRECTIONS = {1: "up", -1: "down"}


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownValve:
    """The intervals that the proof is for: m.

    Attributes:
        low_m, high_m: lo, hi.
        scatter_m: S.
        onward, turning: break-away, the wider of both directions.
        friction_m: F_c/k_s.
        rounded_m: how far the device rounds where a slide lands.
    """

    low_m: float
    high_m: float
    scatter_m: float
    onward: Interval
    turning: Interval
    friction_m: float
    rounded_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """The bounds."""

    most_slides: int
    beyond_m: float
    """The greatest way beyond that between stem and reference."""
    ends_within_m: float


@dataclass(frozen=True, slots=True)
class Refused:
    """What is not proved, and what would have to be known better for it."""

    why: str
    parameter: str


def known_valve(knowledge: ValveKnowledge, bounds: SlideBounds) -> KnownValve | Refused:
    """Return the intervals that an identification has left.

    The balance lies within what its landings lie off the straight law by, give or take their scatter: three deviations
    of what successive ones in a direction differ by.
    """
    slope_pa_per_m, apart_m = -knowledge.ratios.b_over_c, [LEAST_SCATTER * bounds.stroke_m]
    off_m: list[float] = []
    for direction, name in DIRECTIONS.items():
        own = [each for each in knowledge.landings if each.direction == direction]
        if len(own) < FEWEST:
            return Refused(f"fewer than {FEWEST} landings {name}", f"friction {name}")
        left_m = [
            (each.command_pa - knowledge.ratios.balance_pa(each.position_m, direction)) / slope_pa_per_m for each in own
        ]
        off_m += left_m
        apart_m.append(1.4826 * median(abs(a - b) for a, b in pairwise(left_m)) / sqrt(2.0))
        if compliance(knowledge.held, direction) is not None:
            return Refused(f"the packing gives way {name}", "packing: only a stiff one is proved")
    distances = knowledge.distances
    if distances is None:
        return Refused("no slide has been made under the law", "break-away distances")
    onward, turning = distances[:2], distances[2:]
    if not all(each.seen and each.held_m > 0.0 for each in distances):
        return Refused("a direction in which no slide has held, or none has broken loose", "break-away distances")
    rounded_m = 0.5 * bounds.command_step_pa / slope_pa_per_m
    scatter_m = DEVIATIONS * max(*apart_m, median(each.std_m for each in knowledge.landings)) + rounded_m
    return KnownValve(
        low_m=min(off_m) - scatter_m,
        high_m=max(off_m) + scatter_m,
        scatter_m=scatter_m,
        onward=_both(*onward),
        turning=_both(*turning),
        friction_m=knowledge.friction_m,
        rounded_m=rounded_m,
    )


def _both(up: Interval, down: Interval) -> Interval:
    """Return the interval that holds both."""
    return Interval(min(up.held_m, down.held_m), max(up.broke_m, down.broke_m), seen=up.seen and down.seen)


@dataclass(frozen=True, slots=True)
class Reach:
    """How far the ways of an interval go, whatever its slides have taught: m."""

    likely_m: float
    """The shortest that is tried."""
    longest_m: float
    holds: int
    """n, beside the first of a move."""

    @classmethod
    def of(cls, known: Interval, local: float, amiss_m: float, missed: float) -> "Reach":
        """Return that of an interval, which goes over the travel by a factor, the balance being known amiss."""
        least_m = (1.0 - missed) * (known.held_m / local - amiss_m) / local**2
        enough_m = known.broke_m * local + amiss_m
        if least_m <= 0.0:
            return cls(0.0, inf, 0)
        way_m, holds, raised = least_m, 0, known.broke_m * local
        factor = RAISE
        while way_m < enough_m:
            raised = max(raised, factor * local**2 * enough_m)
            way_m, holds, factor = way_m * factor / local**2, holds + 1, GROWS
        ratio = max(known.broke_m / known.held_m, RAISE**2, GROWS, 1.0 / FADED)
        return cls(least_m / sqrt(ratio), raised, holds)


def certified(known: KnownValve, bounds: SlideBounds) -> Certificate | Refused:
    """Return what is proved of a law, by its bounds and thresholds, on every valve inside the intervals."""
    thresholds, band_m, stroke_m = bounds.thresholds, bounds.dead_band_m, bounds.stroke_m
    least_m, most_m = min(0.0, known.low_m) - known.scatter_m, max(0.0, known.high_m) + known.scatter_m
    amiss_m = max(known.high_m - least_m, most_m - known.low_m)
    error_m = amiss_m + known.scatter_m
    worst = "scatter of the landings" if 4.0 * known.scatter_m >= amiss_m else "balance: its bend over the travel"
    if max(-least_m, most_m) > LEAST_SHIFT * stroke_m:
        return Refused(f"slides land {_mm(max(-least_m, most_m))} off the straight law, which may be replaced", worst)
    local = local_factor(known, stroke_m)
    for each, name in ((known.onward, "going on"), (known.turning, "turning")):
        if not (each.seen and each.held_m > 0.0 and each.broke_m <= WIDEST * each.held_m and local**2 < RAISE):
            return Refused(f"break-away {name} is not known well enough", _of_breakaway(each))
    onward, turning = (Reach.of(each, local, amiss_m, thresholds.missed) for each in (known.onward, known.turning))
    shortest_m = shortest_seen_m(bounds) + known.rounded_m
    spare_m = (thresholds.return_margin - 1.0) * turning.likely_m + known.rounded_m
    allowed_m = min(spare_m, thresholds.missed * max(shortest_m, min(onward.likely_m, turning.likely_m)))
    if error_m > allowed_m:
        narrow_m = (thresholds.return_margin - 1.0) * known.turning.broke_m
        why = f"a slide lands {_mm(error_m)} off, and for the way back {_mm(allowed_m)} are to spare"
        return Refused(why, worst if error_m > narrow_m else _of_breakaway(known.turning))
    landings = 2
    if error_m > band_m:
        if thresholds.widening <= 1.0:
            return Refused(f"slides land {_mm(error_m)} off, and the dead band of {_mm(band_m)} does not widen", worst)
        landings = 2 * (1 + ceil(log(error_m / band_m) / log(thresholds.widening))) + 1
    slides = landings + 1 + 2 * (onward.holds + turning.holds)
    if slides > thresholds.most_slides:
        widest = max((known.onward, known.turning), key=lambda each: each.broke_m / each.held_m)
        parameter = worst if landings > slides - landings else _of_breakaway(widest)
        return Refused(f"{slides} slides may be needed, and a move has {thresholds.most_slides}", parameter)
    beyond_m = max(thresholds.return_margin * turning.longest_m, onward.longest_m, shortest_m) + known.rounded_m
    return Certificate(
        most_slides=slides,
        beyond_m=min(beyond_m, bounds.excursion_limit_m) + error_m,
        ends_within_m=max(band_m, error_m),
    )


def local_factor(known: KnownValve, stroke_m: float) -> float:
    """Return Λ; infinite where friction is not told from how far slides land off."""
    width_m = max(0.0, known.high_m) - min(0.0, known.low_m) + 2.0 * known.scatter_m
    half_m, reach_m = 0.5 * width_m, THRESHOLDS.slope_reach * stroke_m
    if half_m >= min(known.friction_m, reach_m):
        return inf
    return (known.friction_m + half_m) / (known.friction_m - half_m) * (reach_m + half_m) / (reach_m - half_m)


def _of_breakaway(interval: Interval) -> str:
    return f"break-away: between {_mm(interval.held_m)} and {_mm(interval.broke_m)}"


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.3g} mm"

"""Bounds of the law on an identified valve: that each move ends, in how many slides, how far beyond.

They are no proof yet: of drawn valves some one in 1000 exceeds them (`benchmarks.certified_valves`), for what a bend
learnt at one place does to another, 1.5 B, is not derived.

A slide towards r in a direction lands e off, for the balance is known amiss by b there, and slides scatter by ε; what
it missed corrects the balance by a share g = 1/(1 + w_0) of that (`local_balance.HELD_BACK`). The landing map is

    e' = b + ε,   b' = (1 - g) b - ε''        abs(b) <= B, abs(ε) <= S, abs(ε'') <= 3 S, carried on as intervals:
    E' = B + S,   B' = abs(1 - g) B + 3 S

ε'' being what scatter teaches: over the travel, by the way sent, and nearby, each no more than S. What is learnt at one
place is carried on to others, and may be amiss there by 1.5 B. Break-away goes over the travel as friction over slope
does, and both are told from landings, amiss by E: by a factor of 1 + 5 E/friction. And d, the break-away distance of
each direction, of going on and of turning, lies in held < d <= broke. Proved is, if every valve inside these intervals
has it:

    a slide that is planned holds H times at most, until it goes B farther than has broken loose       (`Interval`)
    the way back from an excursion breaks loose: E_2 <= (1.02 - 1) d + what is added for rounding
    after k excursions the stem is within the dead band, which has widened: E_k <= band 1.5^(k - 1)
    these are N = 2 k + 2 [E_1 is more than the way back has left] + H_out + 2 H_back slides: no more than a move has

Then a move ends, nothing moves until the reference changes, and there is no limit cycle. The stem was never farther
beyond its way than max(1.02 d_turning, d_going on) + rounding + E_1, d the longest of the ways so tried. What cannot be
proved is refused, with what would have to be known better.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from statistics import median

from positioner.control.laws.slides.slide_balance import Balance
from positioner.control.laws.slides.slide_bounds import SlideBounds
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval, Went
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.local_balance import HELD_BACK, bent_by_pa

DEVIATIONS = 3.0
LEAST_SCATTER = 1e-5
"""Of the stroke: no slides repeat themselves better."""
CARRIED_ON = 1.5
"""Times B: where a bend that was learnt elsewhere leads. Of 5368 drawn valves one was off by 1.3."""
MANY = 14
"""Slides that hold in a row: no move has so many."""
FEWEST = 3
"""Landings in a direction from which their scatter is told."""
PLACES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Of the stroke, where break-away is looked at."""
DIRECTIONS = {1: "up", -1: "down"}


@dataclass(frozen=True, slots=True, kw_only=True)
class KnownValve:
    """What the proof is for: m.

    Attributes:
        balance_m: B, how far slides may land off for the balance is known amiss.
        scatter_m: S, how far one may land off another.
        distances: break-away, in the middle of the travel.
        friction_m: F_c/k_s.
        local: by what factor they are longer elsewhere, at the most.
        quantum_m: of the position.
        rounded_m: how far the device rounds where a slide lands.
    """

    balance_m: float
    scatter_m: float
    distances: BreakawayDistance
    friction_m: float
    local: float = 1.0
    quantum_m: float = 0.0
    rounded_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """The bounds: for every reference within the travel, whatever the slides scatter."""

    most_slides: int
    beyond_m: float
    """The greatest way beyond that between stem and reference."""
    ends_within_m: float


@dataclass(frozen=True, slots=True)
class Refused:
    """What is not, and what would have to be known better for it."""

    why: str
    parameter: str


@dataclass(frozen=True, slots=True)
class Box:
    """The interval of the error of a landing, and of how far the balance is known amiss: half-widths, m."""

    error_m: float
    balance_m: float

    def after_landing(self, gain: float, scatter_m: float) -> "Box":
        """Return the box after one more landing."""
        return Box(self.balance_m + scatter_m, abs(1.0 - gain) * self.balance_m + 3.0 * scatter_m)


def known_valve(knowledge: ValveKnowledge, stroke_m: float) -> KnownValve | Refused:
    """Return the intervals that an identification has left.

    What landings leave of the bent law is by how much the balance may be known amiss, and what successive ones in a
    direction differ by is their scatter, three deviations of each.
    """
    if knowledge.distances is None:
        return Refused("no slide has been made under the law", "break-away distances")
    slope_pa_per_m, off_m, apart_m = -knowledge.ratios.b_over_c, [0.0], [LEAST_SCATTER * stroke_m]
    for direction, name in DIRECTIONS.items():
        own = [each for each in knowledge.landings if each.direction == direction]
        if len(own) < FEWEST:
            return Refused(f"fewer than {FEWEST} landings {name}", "friction " + name)
        left_m = [_off_pa(each, knowledge, stroke_m) / slope_pa_per_m for each in own]
        off_m += [abs(each) for each in left_m]
        apart_m.append(1.4826 * median(abs(a - b) for a, b in pairwise(left_m)) / sqrt(2.0))
    scatter_m = DEVIATIONS * max(*apart_m, median(each.std_m for each in knowledge.landings))
    balance = Balance(knowledge.ratios, knowledge.landings, knowledge.held, stroke_m)
    places = (balance.local(share * stroke_m) for share in PLACES)
    return KnownValve(
        balance_m=max(off_m) + scatter_m,
        scatter_m=scatter_m,
        distances=knowledge.distances,
        friction_m=knowledge.friction_m,
        local=max(max(each) for each in places),
    )


def _off_pa(each: SlideOutcome, knowledge: ValveKnowledge, stroke_m: float) -> float:
    straight_pa = knowledge.ratios.balance_pa(each.position_m, each.direction)
    bent_pa = bent_by_pa(each.position_m, each.direction, knowledge.ratios, knowledge.landings, stroke_m)
    return each.command_pa - straight_pa - bent_pa


def certified(known: KnownValve, bounds: SlideBounds, held_back: float = HELD_BACK) -> Certificate | Refused:
    """Return what can be proved of a law on a valve.

    Args:
        known: the valve's intervals.
        bounds: of the law, with its thresholds.
        held_back: w_0, by which the law learns from what slides miss.
    """
    thresholds = bounds.thresholds
    if not 0.0 <= held_back < 1.0:
        return Refused("what slides miss is not corrected to less", "the law: held_back")
    gain, band_m = 1.0 / (1.0 + held_back), bounds.dead_band_m
    learnt = Box(0.0, known.balance_m).after_landing(gain, known.scatter_m)
    amiss_m = max(CARRIED_ON * known.balance_m, learnt.balance_m)
    first = Box(0.0, amiss_m).after_landing(gain, known.scatter_m)
    second = first.after_landing(gain, known.scatter_m)
    told = 1.0 + 5.0 * first.error_m / known.friction_m
    onward, turning = (
        [known.distances.at(s, turning=each).times(known.local * told) for s in DIRECTIONS] for each in (False, True)
    )
    if not all(each.seen for each in (*onward, *turning)):
        return Refused("a direction in which no slide has broken loose", "break-away distances")
    shortest_m = thresholds.shortest * bounds.stroke_m
    rounding_m = thresholds.rounded_quanta * known.quantum_m + known.rounded_m
    spare_m = (thresholds.return_margin - 1.0) * min(each.likely_m for each in turning) / told + rounding_m
    if second.error_m > spare_m:
        return Refused(
            f"the way back may be too short: a slide lands {_mm(second.error_m)} off, and {_mm(spare_m)} is to spare",
            _of_error(known),
        )
    count = _excursions(first, gain, known.scatter_m, band_m, bounds)
    if count is None:
        return Refused(f"slides land {_mm(second.error_m)} off, and the dead band is {_mm(band_m)}", _of_error(known))
    tried_onward, tried_turning = (max((_tried(each, amiss_m) for each in both), key=len) for both in (onward, turning))
    out, back = max(len(tried_onward), len(tried_turning)) - 1, len(tried_turning) - 1
    slides = 2 * count + 2 * (first.error_m > spare_m) + out + 2 * back
    if slides > thresholds.most_slides:
        widest = max((*onward, *turning), key=lambda each: each.broke_m / max(each.held_m, shortest_m))
        apart = f"between {_mm(widest.held_m)} and {_mm(widest.broke_m)}"
        return Refused(
            f"{slides} slides may be needed, and a move has {thresholds.most_slides}", f"break-away: {apart}"
        )
    turns_m, goes_on_m = (max(shortest_m, *(max(_tried(each, amiss_m)) for each in both)) for both in (turning, onward))
    beyond_m = max(thresholds.return_margin * turns_m, goes_on_m) + rounding_m
    return Certificate(
        most_slides=slides,
        beyond_m=min(beyond_m, bounds.excursion_limit_m) + first.error_m,
        ends_within_m=max(band_m, min(first.error_m, _widened_m(band_m, slides, bounds))),
    )


def _excursions(first: Box, gain: float, scatter_m: float, band_m: float, bounds: SlideBounds) -> int | None:
    """Return after how many excursions the stem is within the band for sure; None: it never is."""
    box = first
    for count in range(1, bounds.thresholds.most_slides // 2 + 1):
        if box.error_m <= _widened_m(band_m, 2 * count, bounds):
            return count
        box = box.after_landing(gain, scatter_m)
    return None


def _widened_m(band_m: float, landed: int, bounds: SlideBounds) -> float:
    """Return the dead band after so many landings, m."""
    beyond = max(0, landed - bounds.thresholds.free_landings)
    return band_m * float(bounds.thresholds.widening) ** (beyond // 2)


def _tried(interval: Interval, amiss_m: float) -> list[float]:
    """Return the ways, m, that are sent until the stem breaks loose for sure, the balance being known amiss.

    The last one is the first that is as long as has broken loose, and by so much longer.
    """
    way_m = interval.likely_m
    ways_m, enough_m = [way_m], interval.broke_m + amiss_m
    while ways_m[-1] < enough_m and len(ways_m) <= MANY:
        interval = interval.taught(Went(ways_m[-1], 0.0, moved=False, arrived=False), turning=True)
        ways_m.append(interval.sure_m)
    return ways_m


def _of_error(known: KnownValve) -> str:
    """Return which part of where a slide lands is known worst."""
    return "scatter of the landings" if known.scatter_m >= known.balance_m / 2 else "balance: spring and friction"


def _mm(length_m: float) -> str:
    return f"{1e3 * length_m:.3g} mm"

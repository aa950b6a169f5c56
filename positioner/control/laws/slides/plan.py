"""Which slides bring a stem from its rest to where it shall be: one, or two by way of an excursion.

    B(x, s)    pressure under which a slide in direction s lands at x            (slide_balance.py)
    d_s        shortest slide that breaks loose in direction s                   (breakaway_distance.py)

With the stem at rest at x, e = r - x and s = sign(e):

    abs(e) >= d_s      one slide:   u = B(r, s)
    else               two slides:  u = B(r + s D, s), wait until it rests, u = B(r, -s)
                                    D = max(1.02 d_-s, d_s - abs(e))

The first of two slides leaves the way between x and r by D: an excursion. It goes the other way round, by r - s D' with
D' = max(1.02 d_s, d_-s + abs(e)), where it leaves the way between by less, D' - abs(e) < D, for turning and going on
differ, or where a bound of the site, of the travel or of the pressure bars one of the two. To 1.02 d comes what sensor
and device round: a first slide that fell so much short would leave no way back.

    c         how far a packing gives way, m/Pa        (packing_compliance.py)

Where the packing gives way, a stem under p is moved directly, by u = p + e/c, as long as it holds at r:

    s (u - B(r, s))/κ <= 0.9 of the longest way that held
"""

from dataclasses import dataclass
from typing import NamedTuple

from config.codes import InhibitReason
from positioner.control.laws.slides.reference_course import ReferenceCourse
from positioner.control.laws.slides.slide_balance import Balance
from positioner.control.laws.slides.slide_bounds import SlideBounds
from positioner.control.laws.slides.slide_memory import Anchor
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval, Local
from positioner.estimation.landings.landing_detector import VISIBLE
from positioner.estimation.landings.packing_compliance import compliance


class Excursion(NamedTuple):
    """The direction of its first slide, by which place it goes, and how far beyond the move, m."""

    direction: int
    by_m: float
    beyond_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What is needed to plan a move to a target, m, from where the stem stands."""

    bounds: SlideBounds
    balance: Balance
    distances: BreakawayDistance
    local: Local
    """Of the target."""
    anchor: Anchor | None
    from_m: float
    target_m: float
    quantum_m: float
    preslides: bool
    """Whether the stem may still be moved directly."""
    surely: bool
    """Whether the next slide goes as far as has broken loose: what may do has been tried."""

    def interval(self, direction: int, *, turning: bool) -> Interval:
        """Return the break-away distance of a slide at the target."""
        return self.distances.at(direction, turning=turning, local=self.local)

    def turns(self, direction: int) -> bool:
        """Whether a slide in a direction would turn round; where that is not known, it does."""
        return self.anchor is None or self.anchor.turns(direction)

    def breaks_loose_m(self, direction: int, *, turning: bool) -> float:
        """Return how far a slide must be sent to break loose, m, be it seen for a slide or not."""
        interval = self.interval(direction, turning=turning)
        sure_m = interval.sure_m
        return sure_m if self.surely and sure_m <= self.bounds.excursion_limit_m else interval.likely_m

    @property
    def shortest_m(self) -> float:
        """The shortest slide that is sent, m: it is seen for one, however it is rounded."""
        return shortest_seen_m(self.bounds) + self.rounded_m

    def way_m(self, direction: int, *, turning: bool | None = None) -> float:
        """Return how far a slide must be sent, m; by default as it would go from where the stem stands."""
        turning = self.turns(direction) if turning is None else turning
        return max(self.breaks_loose_m(direction, turning=turning), self.shortest_m)

    def back_m(self, direction: int) -> float:
        """Return how far beyond its target a stem is sent, m, that is to come back by a slide in a direction."""
        turning_m = self.bounds.thresholds.return_margin * self.breaks_loose_m(direction, turning=True)
        return max(turning_m + self.rounded_m, self.shortest_m)

    def preslid_pa(self, from_m: float, from_pa: float) -> float | None:
        """Return the pressure under which a packing gives way from a place, m, under a pressure, to the target, Pa.

        None: not so far, or not for sure. It costs no travel, and one rest where an excursion takes two: it is better
        wherever it leaves no more than a share of the error. The spring of the stuck stem is 1/c.
        """
        error_m, thresholds = self.target_m - from_m, self.bounds.thresholds
        s = 1 if error_m > 0 else -1
        if not self.preslides or abs(error_m) > thresholds.longest_giving * self.bounds.stroke_m:
            return None
        gives = compliance(self.balance.held, s)
        if gives is None or gives.spread > thresholds.preslid_within:
            return None
        command_pa = from_pa + error_m / gives.m_per_pa
        held_m = thresholds.presliding * self.interval(s, turning=False).held_m
        holds = s * (command_pa - self.balance.pressure_pa(self.target_m, s)) <= held_m * -self.balance.ratios.b_over_c
        return command_pa if holds and self.bounds.allows(command_pa) else None

    def excursions(self, *, begun: bool) -> tuple[Excursion, Excursion]:
        """Return the excursions by either side, first the one that goes less far beyond the move.

        The move is the way between stem and target. A stem that a slide of the move has brought there is off that way
        already (begun), and while references keep coming there is none: then the target alone counts.
        """
        error_m = self.target_m - self.from_m
        s, way_m = (1 if error_m > 0 else -1), abs(error_m)
        on_m = max(self.back_m(-s), self.way_m(s) - way_m)
        round_m = max(self.back_m(s), self.way_m(-s) + way_m)
        around_m = round_m if begun else round_m - way_m
        by_its_side = Excursion(direction=s, by_m=self.target_m + s * on_m, beyond_m=on_m)
        by_the_other = Excursion(direction=-s, by_m=self.target_m - s * round_m, beyond_m=around_m)
        longer = self.bounds.thresholds.other_side
        return (by_its_side, by_the_other) if on_m <= longer * around_m else (by_the_other, by_its_side)

    def barred(self, each: Excursion) -> InhibitReason:
        """Return which bound of the site bars an excursion; `NOTHING`: none does."""
        low_m, high_m = self.balance.stops_m
        if each.beyond_m > self.bounds.excursion_limit_m or not low_m <= each.by_m <= high_m:
            return InhibitReason.EXCURSION_BEYOND_LIMIT
        both_pa = (
            self.balance.pressure_pa(each.by_m, each.direction),
            self.balance.pressure_pa(self.target_m, -each.direction),
        )
        allowed = all(self.bounds.allows(each_pa) for each_pa in both_pa)
        return InhibitReason.NOTHING if allowed else InhibitReason.LAW_BEYOND_LIMITS

    def lead_m(self, course: ReferenceCourse, now_s: float, direction: int) -> float:
        """Return how far ahead of a ramp to land, m, where the site's bounds let it."""
        lead_m = course.lead_m(now_s, self.way_m(direction))
        to_m, (low_m, high_m) = self.target_m + lead_m, self.balance.stops_m
        ahead = 0.0 < direction * lead_m <= self.bounds.excursion_limit_m and low_m <= to_m <= high_m
        return lead_m if ahead and self.bounds.allows(self.balance.pressure_pa(to_m, direction)) else 0.0

    def back_pa(self, direction: int, position_m: float, goes_on_m: float) -> float:
        """Return what to hold, Pa, if something interrupts the first of two slides, in a direction, at a position.

        From beyond a distance that has broken loose the stem comes back to its target. From nearer it might not break
        loose: it goes as far beyond the target on the other side as it lacks, if that is nearer than where it is.
        """
        s, interval = direction, self.interval(-direction, turning=True)
        beyond_m = s * (position_m + goes_on_m - self.target_m)
        lacks_m = self.bounds.thresholds.return_margin * interval.sure_m - beyond_m
        to_m = self.target_m - s * max(0.0, lacks_m) if beyond_m > lacks_m else self.target_m
        return self.bounds.allowed_pa(self.balance.slide_pa(position_m, to_m, -s))

    @property
    def rounded_m(self) -> float:
        """By how much sensor and device round where a slide lands, m."""
        return self.bounds.thresholds.rounded_quanta * self.quantum_m + beside_m(self.bounds, self.balance)


def shortest_seen_m(bounds: SlideBounds) -> float:
    """Return how far a stem must go to be seen to slide, m: else its packing may have given way."""
    return VISIBLE * bounds.stroke_m


def beside_m(bounds: SlideBounds, balance: Balance) -> float:
    """Return how far beside its aim a slide may land, m, where the device is told whole numbers: by half a step."""
    return 0.5 * bounds.command_step_pa / -balance.ratios.b_over_c

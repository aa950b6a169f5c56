"""Which slides bring a stem from its rest to where it shall be: one, or two by way of an excursion.

    B(x, s)    pressure under which a slide in direction s lands at x            (slide_pressure.py)
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
from functools import cached_property
from typing import NamedTuple

from config.codes import InhibitReason
from positioner.control.laws.slides.now import Now
from positioner.control.laws.slides.slide_bounds import DAY_S, SlideBounds
from positioner.control.laws.slides.slide_memory import SlideMemory
from positioner.control.laws.slides.slide_states import Out, Slide
from positioner.estimation.landings.breakaway_distance import Interval
from positioner.estimation.landings.landing_detector import VISIBLE
from positioner.estimation.landings.packing_compliance import compliance


class Excursion(NamedTuple):
    """The direction of its first slide, by which place it goes, and how far beyond the move, m."""

    direction: int
    by_m: float
    beyond_m: float


@dataclass(frozen=True)
class Plan:
    """A move to the reference from where a stem stands, m, by what is remembered."""

    now: Now
    memory: SlideMemory
    from_m: float

    @classmethod
    def at_rest(cls, memory: SlideMemory, now: Now) -> "Plan":
        """Return that of a stem at rest: it begins where the last slide ended, whatever the packing has given since."""
        return cls(now, memory, now.at_rest.position_m if memory.anchor is None else memory.anchor.position_m)

    @property
    def used_up(self) -> bool:
        """Whether the move has had its slides, save the second of two."""
        return self.memory.move.left <= 0 and not isinstance(self.memory.state, Out)

    @property
    def left_away(self) -> bool:
        """Whether a slide of the move has left the stem away."""
        away_m = abs(self.now.reference_m - self.from_m)
        return self.memory.move.given_s is not None and away_m > 0.5 * self.back_m(self.now.side)

    @property
    def surely(self) -> bool:
        """Whether the next slide goes as far as has broken loose: what may do has been tried."""
        return self.memory.move.held or self.memory.move.landed >= self.now.bounds.thresholds.tried

    def interval(self, direction: int, *, turning: bool) -> Interval:
        """Return the break-away distance of a slide at the reference."""
        assert self.memory.distances is not None, "known since the first step"
        return self.memory.distances.at(direction, turning=turning, local=self.now.local)

    def turns(self, direction: int) -> bool:
        """Whether a slide in a direction would turn round; where that is not known, it does."""
        return self.memory.anchor is None or self.memory.anchor.turns(direction)

    def slide(self, to_m: float, direction: int) -> Slide:
        """Return the slide to a place, m."""
        turning = None if self.memory.anchor is None else self.turns(direction)
        return Slide(from_m=self.from_m, to_m=to_m, direction=direction, turning=turning)

    def breaks_loose_m(self, direction: int, *, turning: bool) -> float:
        """Return how far a slide must be sent to break loose, m, be it seen for a slide or not."""
        interval = self.interval(direction, turning=turning)
        sure_m = interval.sure_m
        return sure_m if self.surely and sure_m <= self.now.bounds.excursion_limit_m else interval.likely_m

    @property
    def rounded_m(self) -> float:
        """By how much sensor and device round where a slide lands, m."""
        return self.now.bounds.thresholds.rounded_quanta * self.now.quantum_m + self.now.beside_m

    @property
    def shortest_m(self) -> float:
        """The shortest slide that is sent, m: it is seen for one, however it is rounded."""
        return shortest_seen_m(self.now.bounds) + self.rounded_m

    def way_m(self, direction: int, *, turning: bool | None = None) -> float:
        """Return how far a slide must be sent, m; by default as it would go from where the stem stands."""
        turning = self.turns(direction) if turning is None else turning
        return max(self.breaks_loose_m(direction, turning=turning), self.shortest_m)

    def back_m(self, direction: int) -> float:
        """Return how far beyond its target a stem is sent, m, that is to come back by a slide in a direction."""
        turning_m = self.now.bounds.thresholds.return_margin * self.breaks_loose_m(direction, turning=True)
        return max(turning_m + self.rounded_m, self.shortest_m)

    def preslid_pa(self) -> float | None:
        """Return the pressure under which the packing of a stem at rest gives way to the target, Pa.

        None: not so far, or not for sure. It costs no travel, and one rest where an excursion takes two: it is better
        wherever it leaves no more than a share of the error. The spring of the stuck stem is 1/c.
        """
        now, thresholds, s = self.now, self.now.bounds.thresholds, self.now.side
        if self.memory.move.preslid >= thresholds.most_preslid or abs(now.error_m) > now.bounds.longest_giving_m:
            return None
        gives = compliance(now.balance.held, s)
        if gives is None or gives.spread > thresholds.preslid_within:
            return None
        command_pa = self.memory.command_pa + now.error_m / gives.m_per_pa
        held_m = thresholds.presliding * self.interval(s, turning=False).held_m
        holds = s * self.ahead_m(command_pa, s) <= held_m
        return command_pa if holds and now.bounds.allows(command_pa) else None

    def ahead_m(self, command_pa: float, direction: int) -> float:
        """Return how far beyond its target a command holds a slide in balance, m, signed."""
        balance = self.now.balance
        return (command_pa - balance.pressure_pa(self.now.reference_m, direction)) / -balance.ratios.b_over_c

    def excursions(self) -> tuple[Excursion, Excursion]:
        """Return the excursions by either side, first the one that goes less far beyond the move.

        The move is the way between stem and target. A stem that a slide of the move has brought there is off that way
        already, and while references keep coming there is none: then the target alone counts.
        """
        now, course = self.now, self.memory.course
        begun = self.memory.move.landed > 0 or bool(course and course.changes_m)
        error_m = now.reference_m - self.from_m
        s, way_m = (1 if error_m > 0 else -1), abs(error_m)
        on_m = max(self.back_m(-s), self.way_m(s) - way_m)
        round_m = max(self.back_m(s), self.way_m(-s) + way_m)
        around_m = round_m if begun else round_m - way_m
        by_its_side = Excursion(direction=s, by_m=now.reference_m + s * on_m, beyond_m=on_m)
        by_the_other = Excursion(direction=-s, by_m=now.reference_m - s * round_m, beyond_m=around_m)
        longer = now.bounds.thresholds.other_side
        return (by_its_side, by_the_other) if on_m <= longer * around_m else (by_the_other, by_its_side)

    def barred(self, each: Excursion) -> InhibitReason:
        """Return which bound of the site bars an excursion, what is spent of a day's travel last; `NOTHING`: none."""
        bounds, balance, (low_m, high_m) = self.now.bounds, self.now.balance, self.now.balance.stops_m
        if each.beyond_m > bounds.excursion_limit_m or not low_m <= each.by_m <= high_m:
            return InhibitReason.EXCURSION_BEYOND_LIMIT
        both = ((each.by_m, each.direction), (self.now.reference_m, -each.direction))
        allowed = all(bounds.allows(balance.pressure_pa(*to)) for to in both)
        if not allowed:
            return InhibitReason.LAW_BEYOND_LIMITS
        spent = 0.0 < bounds.budget_m_per_s * DAY_S < self.spent_m(each) and not self.left_away
        return InhibitReason.EXCURSION_BUDGET_SPENT if spent else InhibitReason.NOTHING

    def spent_m(self, each: Excursion) -> float:
        """Return what is spent of a day's travel with an excursion, m."""
        before = self.memory.excursions
        return (before.spent_at_m(self.now.now_s, self.now.bounds) if before else 0.0) + 2 * each.beyond_m

    @cached_property
    def bars(self) -> tuple[tuple[Excursion, InhibitReason], ...]:
        """The excursions by either side, with what bars each."""
        return tuple((each, self.barred(each)) for each in self.excursions())

    def lead_m(self, direction: int) -> float:
        """Return how far ahead of a ramp to land, m, where the site's bounds let it."""
        now, course = self.now, self.memory.course
        lead_m = 0.0 if course is None else course.lead_m(now.now_s, self.way_m(direction), now.answer_s)
        to_m, (low_m, high_m) = now.reference_m + lead_m, now.balance.stops_m
        ahead = 0.0 < direction * lead_m <= now.bounds.excursion_limit_m and low_m <= to_m <= high_m
        return lead_m if ahead and now.bounds.allows(now.balance.pressure_pa(to_m, direction)) else 0.0

    def back_pa(self, direction: int, goes_on_m: float) -> float:
        """Return what to hold, Pa, if something interrupts the first of two slides, in a direction.

        From beyond a distance that has broken loose the stem comes back to its target. From nearer it might not break
        loose: it goes as far beyond the target on the other side as it lacks, if that is nearer than where it is.
        """
        s, interval, target_m = direction, self.interval(-direction, turning=True), self.now.reference_m
        beyond_m = s * (self.from_m + goes_on_m - target_m)
        lacks_m = self.now.bounds.thresholds.return_margin * interval.sure_m - beyond_m
        to_m = target_m - s * max(0.0, lacks_m) if beyond_m > lacks_m else target_m
        return self.now.bounds.allowed_pa(self.now.balance.slide_pa(self.from_m, to_m, -s))


def shortest_seen_m(bounds: SlideBounds) -> float:
    """Return how far a stem must go to be seen to slide, m: else its packing may have given way."""
    return VISIBLE * bounds.stroke_m

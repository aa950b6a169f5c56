"""What the law of slides knows of the valve: where a slide lands, and how break-away distances go over the travel.

    B(x, s)    pressure under which a slide in direction s lands at x            (estimation/landings/local_balance.py)
    φ, κ       friction and slope of B, as bent over the travel
    d_s        shortest slide that breaks loose in direction s, (F_s - F_c)/k_s

Where friction grows over the travel its static part grows alike, so d_s goes as φ/κ.
"""

from dataclasses import dataclass, replace
from functools import cached_property

from config.extended_valve import ExtendedValve
from positioner.control.laws.slides.slide_bounds import THRESHOLDS
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval
from positioner.estimation.landings.landing_detector import VISIBLE, SlideOutcome
from positioner.estimation.landings.local_balance import LocalBalance


@dataclass(frozen=True, kw_only=True)
class Balance(LocalBalance):
    """What the law knows of the valve: where slides land, and what held the stem; the latest first."""

    held: tuple[SlideOutcome, ...]
    swing: float = 0.0
    """ρ, share of its way by which the stem swings past its balance (estimation/landings/overshoot.py)."""

    def slide_pa(self, from_m: float, to_m: float, direction: int) -> float:
        """Return the pressure under which a slide from rest ends at a place, Pa: at its balance, or swung past it."""
        return self.pressure_pa(to_m - self.swing * (to_m - from_m), direction, abs(to_m - from_m))

    def tried(self, way_m: float, direction: int) -> int:
        """Return how many of the last slides that landed in a direction were sent about so far, m."""
        sent_m = (self.ahead_m(each, self.swing) for each in self.landings if each.direction == direction)
        return sum(abs(each_m - way_m) < THRESHOLDS.sent_alike * way_m for each_m in sent_m)

    @property
    def stops_m(self) -> tuple[float, float]:
        """The ends of the travel, m, as far as is known."""
        return (0.0, self.stroke_m) if self.valve is None else self.valve.stops_m

    @property
    def friction_m(self) -> float:
        """F_c/k_s, m."""
        return self.ratios.k_over_c / self.ratios.b_over_c

    def going_on_m(self, position_m: float) -> float:
        """Return what break-away distances at a place are in proportion to, m: m_s of an extended valve, or φ/κ."""
        if self.valve is not None:
            return 0.5 * sum(self._margin_m(self.valve, position_m, s) for s in (1, -1))
        apart_pa = self._shape_pa(position_m, 1) - self._shape_pa(position_m, -1)
        friction_m = max(THRESHOLDS.flattest * self.friction_m, 0.5 * apart_pa / -self.ratios.b_over_c)
        there_m = [position_m + each * THRESHOLDS.slope_reach * self.stroke_m for each in (-1, 1)]
        down_pa, up_pa = (sum(self._shape_pa(each, s) for s in (1, -1)) for each in there_m)
        straight_pa = -self.ratios.b_over_c * 4 * THRESHOLDS.slope_reach * self.stroke_m
        return friction_m / max(THRESHOLDS.flattest, (up_pa - down_pa) / straight_pa)

    def _margin_m(self, valve: ExtendedValve, position_m: float, direction: int) -> float:
        return max(THRESHOLDS.return_margin * valve.margin_m(position_m, direction), VISIBLE * self.stroke_m)

    def local(self, position_m: float) -> float:
        """Return what break-away distances at a place are of those in the middle of the travel, a factor."""
        return self.going_on_m(position_m) / self._middle_m

    @cached_property
    def _middle_m(self) -> float:
        return self.going_on_m(THRESHOLDS.middle * self.stroke_m)

    def first_distances(self, breakaway_pa: float | None) -> BreakawayDistance:
        """Return the break-away distances before a slide of the law, by what is told of F_s/A, Pa; None: nothing is.

        They are those of the extended valve, or of the staircase, or a guess where no slide has landed in a direction.
        """
        if self.valve is not None:
            both_m = (self._margin_m(self.valve, THRESHOLDS.middle * self.stroke_m, s) for s in (1, -1))
            up, down = (Interval(each / THRESHOLDS.return_margin, each, seen=True) for each in both_m)
            return BreakawayDistance(up, down, up, down)
        guess_m = THRESHOLDS.first_distance * self.friction_m
        if breakaway_pa is not None:
            guess_m = max(guess_m, (breakaway_pa + self.ratios.k_over_c) / -self.ratios.b_over_c)
        guess = Interval(broke_m=guess_m, seen=breakaway_pa is not None)
        return BreakawayDistance(self._first(1, guess), self._first(-1, guess))

    def _first(self, direction: int, guess: Interval) -> Interval:
        """Return the shortest way that has landed in a direction, and the longest below it that held."""
        slid, held = ([each for each in all_ if each.direction == direction] for all_ in (self.landings, self.held))
        slid_m = [self._in_the_middle_m(each, abs(each.position_m - each.from_m)) for each in slid]
        first = Interval(broke_m=min(slid_m) / (1.0 - self.swing), seen=True) if slid_m else guess
        held_m = (self._in_the_middle_m(each, self.ahead_m(each, self.swing)) for each in held)
        seen_m = (each_m for each_m in held_m if VISIBLE * self.stroke_m < each_m < first.broke_m)
        return replace(first, held_m=max(seen_m, default=0.0))

    def _in_the_middle_m(self, each: SlideOutcome, way_m: float) -> float:
        """Return what a way, m, that slide began would be in the middle of the travel."""
        return way_m / self.local(each.from_m)

    def _shape_pa(self, position_m: float, direction: int) -> float:
        """Return B as it goes over the travel, Pa, without what only the last landings near a place say."""
        return self.known_pa(position_m, direction) + self.bent_by_pa(position_m, direction)

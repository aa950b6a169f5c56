"""How far a stem at rest must be sent to break loose, as slides teach it: the break-away distance.

    d = (F_s - F_c)/k_s               of a slide that goes on in the direction of the last
      + (F_s + F_c)/k_p - w           of one that turns round: a packing of stiffness k_p gives way, play w is taken up

F_s, F_c of the direction. So there are four: up and down, going on and turning round. None of what stands above is
known; what is, is an interval, held < d <= broke: the longest way that held the stem, and the shortest that broke it
loose. What a slide sent by a way a taught, that went b:

    it arrived                        broke = b
    it did not move                   held = a
    it went farther than it was sent  both: none is so short, it jumped (behind a slow I/P, where stems stick short)
    it fell short, having turned      held = a: the packing gave way
    it fell short, going on           nothing: friction has grown, which the balance learns
    it was not seen to its end        nothing
    it went twice as far as broke     nothing, wherever it was sent

The interval shrinks by that. It widens by contradiction: where a way holds though so short a one has broken loose, d
lies within `RAISE` of it, to either side; a way that breaks loose though so long a one has held makes held a little
shorter than it. And by time, for friction changes: with each slide held fades.
An interval of which one side is missing has its next of kin's, if that agrees. But once a slide of its own has broken
loose, what held a kin is believed less a factor; and once a way that held the kin has broken it loose, the next is less
by that factor, until one of its own holds. For a play that is taken up makes turning shorter than going on, and a
packing that gives way longer. It is kept as in the middle of the travel, and goes over it as friction over slope does,
φ/κ.
"""

from dataclasses import dataclass, replace
from math import inf, sqrt
from typing import NamedTuple

LOWER, RAISE = 0.5, 1.3
"""Factors on a distance as long as nothing has held, and where what broke loose holds."""
GROWS = 2.0
"""Factor, at most, from what held to what is tried next: what broke loose may have been far longer than needed."""
KIN_FACTOR = 1.25
"""Factor by which kin may differ: what holds one, less that, may hold the other."""
CLOSE = 1.1
"""Broke over held: near enough, nothing between them is tried."""
CONTRADICTED_BOUND_FACTOR = 1.05
"""Factor to a bound that a slide has contradicted."""
FADES, FADED = 0.999, 0.5
"""Factor on held with each slide that breaks loose, so that a shorter way is tried again after some hundred; share of
broke to which it fades, and no farther."""
LONG = 2.0
"""Times broke: a slide longer than this says nothing; where it missed, the balance was known amiss."""


class Went(NamedTuple):
    """What became of a slide: m."""

    sent_m: float
    went_m: float
    moved: bool
    """Whether it went farther than a packing gives way."""
    arrived: bool
    """Whether it came where it was sent, as far as that can be told."""


@dataclass(frozen=True, slots=True)
class Interval:
    """held < d <= broke, m."""

    held_m: float = 0.0
    """0: nothing has held."""
    broke_m: float = inf
    """Infinite: nothing has broken loose."""
    seen: bool = False
    """Whether a slide has shown that, and none since that it holds; else it is a guess."""

    @property
    def likely_m(self) -> float:
        """The way to try, m: one that halves the interval, or, of a narrow one, what broke loose."""
        if not self.held_m:
            return LOWER * self.broke_m
        if self.broke_m <= CLOSE * self.held_m:
            return self.broke_m
        return min(sqrt(self.held_m * self.broke_m), GROWS * self.held_m) if self.broke_m < inf else RAISE * self.held_m

    @property
    def sure_m(self) -> float:
        """The way that has broken loose, m, no more than twice the one to try."""
        return min(self.broke_m, GROWS * self.likely_m)

    def breaking(self, way_m: float) -> "Interval":
        """Return it after a way, m, that broke loose."""
        broke_m = min(self.broke_m, way_m)
        held_m = min(self.held_m, max(FADES * self.held_m, FADED * broke_m))
        if way_m <= self.held_m:
            held_m = way_m / CONTRADICTED_BOUND_FACTOR
        return Interval(held_m, broke_m, self.seen or way_m <= self.broke_m)

    def holding(self, way_m: float) -> "Interval":
        """Return it after a way, m, that held."""
        if self.broke_m > CONTRADICTED_BOUND_FACTOR * way_m:
            return replace(self, held_m=max(self.held_m, way_m))
        if self.seen:  # one such may be luck
            return Interval(max(self.held_m, way_m / RAISE), RAISE * way_m)
        return Interval(max(self.held_m, way_m), GROWS * way_m)

    def taught(self, went: Went, *, turning: bool) -> "Interval":
        """Return it after a slide."""
        if not went.moved:
            return self.holding(went.sent_m)
        if went.went_m > LONG * self.broke_m:
            return self
        if went.arrived:
            return self.breaking(went.went_m)
        if went.went_m < went.sent_m:
            return self.holding(went.sent_m) if turning else self
        return self.holding(went.sent_m).breaking(went.went_m)

    def times(self, factor: float) -> "Interval":
        """Return it so much longer."""
        return Interval(factor * self.held_m, factor * self.broke_m, self.seen)

    def filled(self, kin: "Interval") -> "Interval":
        """Return it with what it lacks of a kin's, if that agrees."""
        if (self.held_m and self.broke_m < inf) or kin.broke_m <= self.held_m:
            return self
        if self.seen:
            broke_m = min(self.broke_m, kin.broke_m) if kin.seen else self.broke_m
            held_m = kin.held_m / KIN_FACTOR if kin.held_m < broke_m else broke_m / KIN_FACTOR**2
            return Interval(held_m, broke_m, self.seen)
        if kin.seen or kin.broke_m < self.broke_m:
            return Interval(self.held_m or kin.held_m, kin.broke_m, kin.seen)
        held_m = kin.held_m / KIN_FACTOR
        return replace(self, held_m=self.held_m or (held_m if held_m < self.broke_m else 0.0))


UNKNOWN = Interval()


class BreakawayDistance(NamedTuple):
    """The four intervals, as in the middle of the travel."""

    onward_up: Interval = UNKNOWN
    onward_down: Interval = UNKNOWN
    turning_up: Interval = UNKNOWN
    turning_down: Interval = UNKNOWN

    def at(self, direction: int, *, turning: bool, local: float = 1.0) -> Interval:
        """Return the interval of slides in a direction at a place; what it lacks is its next of kin's."""
        own = self[_index(direction, turning=turning)]
        for s, t in ((direction, not turning), (-direction, turning), (-direction, not turning)):
            own = own.filled(self[_index(s, turning=t)])
        return own.times(local)

    def taught(self, direction: int, went: Went, *, turning: bool, local: float) -> "BreakawayDistance":
        """Return the distances after a slide in a direction at a place, of which the factor is given."""
        own = _index(direction, turning=turning)
        there = self[own].times(local).taught(went, turning=turning)
        return self._replace(**{self._fields[own]: there.times(1.0 / local)})


def _index(direction: int, *, turning: bool) -> int:
    """Return which of the four intervals is that of slides in a direction."""
    return 2 * turning + (direction < 0)

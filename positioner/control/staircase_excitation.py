"""The excitation of S3 by slides: a staircase up and down inside the travel window, at any period of the loop.

From the pressure in force, steps in one direction, each after the stem has come to rest. R is the rise of the pressure
since the stem last moved:

    first slide        steps of 2 % of the pressure span, growing by 1.3 (5 % at the most), until the stem breaks loose
    the next ones      break-away is narrowed down: R = sqrt(low high) of the largest rise that held and the least that
                       did not, till they are within 15 %, or the slides a fortieth of the window
    from then on       1.05 times the least, or an eighth of the window if that is more: each step is a slide
    at the bound       of the window, or where the next slide would leave it, the staircase turns round

When the landings of both directions give a valid static law it turns round once more, for a landing that closes the
round as a surveyor closes his: a sensor that was shifted meanwhile lands it elsewhere. The first slide after a turn
does not close it: behind a soft packing it is a short one, which a slow pressure lands elsewhere than long ones. Then
the staircase has ended, or after `MOST_TURNS`. No alpha and beta are
needed: break-away is found by the ramp of small steps, and nothing is asked for beyond the window and the pressure
limits.

A stem that is broken loose and does not show it (its sensor is frozen) would be driven out of the window unseen. So W,
all that the pressure went over since the stem last answered, is bounded by what slides have needed:

    going on           W <= 1.5 of the most in this direction, or of the most of a turn, and a first step
    after a turn       W <= 1.5 of the most of a turn, for friction differs over the travel, and a first step
    after the first    W <= what spring balances over the whole stroke, or 2 |h| + R if that is more; 2 |h| + 2 R where
                       the pressure's limit turned it round once more
    before that        W < all that the pressure limits allow: nothing is known, and what breaks it loose is sought once

h = u - k x of a landing: friction and preload, F_c + F_0 upward, k the slope of slides that went on. The first turn
needs F_c + F_s, no more than 2 h + R, for R >= F_s - F_c and a preload closes the valve; to turn once more, 2 F_s.

A stem that goes down while the pressure rises, or up while it falls, twice in a row, is an air-to-close valve's, or its
position is wired the other way round: each further step would take it farther out of the window.
"""

from dataclasses import dataclass, replace
from math import inf, nan, sqrt

from config.codes import InhibitReason
from positioner.control.pressure_clamp import clamped
from positioner.estimation.landings.landing_detector import SlideOutcome

FIRST_STEP, LARGEST_STEP = 0.02, 0.05
"""Of the pressure span."""
GROWTH, SURE = 1.3, 1.05
CLOSE = 1.15
"""The least rise that broke the stem loose over the largest that did not: near enough."""
SHORTEST, MOST_SLIDES = 0.025, 8
"""Of the window: shorter slides are not sought; slides over the window, if break-away allows."""
FEWEST_EACH = 4
"""Landings in each direction ..."""
MANY_EACH = 8
"""... with which break-away need not be found in both."""
WIDE = 0.5
"""Of the window, over which the landings of each direction must lie: what changes over the travel shows there."""
GAVE_WAY = 0.3
"""Of the way that the rise was worth before: a stem that moved less was not broken loose, its packing gave way.

One that moved so far by its last step did slide. The rise before took friction up, as before the first slide
after a turn."""
LEAP = 3.0
"""Rises of the slide before: a rise beyond it is not asked for, for the slope may be that of a packing."""
NOT_COMPLETE = 0.99
NEARLY_TURNED = 0.8
"""Of the rise that turned friction round before: the first step of the last turn, and of each while slides after a turn
go so far that there is no room to go on. Small steps follow, for a short slide."""
MOST_TURNS = 6
UNANSWERED = 1.5
"""Of the most that a slide has needed: a stem that has not answered by then is not where it is said to be, or stuck."""
REVERSED_AFTER = 2
"""Slides in a row against the pressure: one may be a sensor's that was shifted."""
ANSWER, DEVIATIONS = 1e-3, 3.0
"""Of the window; of a rest: a stem that went farther than both has answered, if only its packing gave way."""


@dataclass(frozen=True, slots=True)
class StaircaseLimits:
    """What the staircase must stay inside: m, Pa."""

    low_m: float
    high_m: float
    minimum_pa: float
    maximum_pa: float
    stroke_m: float

    @property
    def span_pa(self) -> float:
        """Between the limits of the pressure."""
        return self.maximum_pa - self.minimum_pa

    @property
    def window_m(self) -> float:
        """Width of the travel window."""
        return self.high_m - self.low_m


@dataclass(frozen=True, slots=True)
class Staircase:
    """A staircase under way.

    Attributes:
        level_pa: command.
        direction: of the steps, +1 up, -1 down.
        step_pa: the last step.
        rise_pa: R, since the stem last moved, or since the staircase turned round.
        low_pa: largest rise that held the stem in this direction.
        high_pa: least that broke it loose, at first as in the other direction; 0: not known.
        slope_pa_per_m: rise over slide of the last slide that went on in its direction.
        slide_m: length of the last slide; 0: none in this direction.
        ups, downs: landings.
        up_m, down_m: way over which they lie, the longest without turning round.
        going_m: the same of the direction it goes in.
        turns: how often it turned round.
        is_limited: whether a limit of the pressure has turned it round inside the window.
        reversal_pa: rise that turned friction round, after a turn; 0: none yet.
        closing: whether it has turned round for the last landing ...
        closed: ... and has had that.
        complete: whether it has given a static law.
        slid_pa: level under which the stem last slid; NaN: not known, for it has not yet, or rests at a stop, which
            bears any excess.
        slid_direction: of that slide; 0: there was none.
        lowest_pa, highest_pa: levels since it last moved visibly at all, or since the staircase began; NaN at a stop.
        against: slides in a row that went against the pressure.
        most_up_pa, most_down_pa, most_turn_pa: longest way of the level from slide to slide, going on and turning.
        turn_pa: 2 |h| + R, the most that the first turn needs; 0: not known.
    """

    level_pa: float
    direction: int = 0
    step_pa: float = 0.0
    rise_pa: float = 0.0
    low_pa: float = 0.0
    high_pa: float = 0.0
    slope_pa_per_m: float = 0.0
    slide_m: float = 0.0
    ups: int = 0
    downs: int = 0
    up_m: float = 0.0
    down_m: float = 0.0
    going_m: float = 0.0
    turns: int = 0
    is_limited: bool = False
    reversal_pa: float = 0.0
    closing: bool = False
    closed: bool = False
    complete: bool = False
    slid_pa: float = nan
    slid_direction: int = 0
    lowest_pa: float = inf
    highest_pa: float = -inf
    against: int = 0
    most_up_pa: float = 0.0
    most_down_pa: float = 0.0
    most_turn_pa: float = 0.0
    turn_pa: float = 0.0

    @property
    def progress(self) -> float:
        """Landings had of those wanted, 0 to 1; 1 when it is complete, not before."""
        had = (min(self.ups, FEWEST_EACH) + min(self.downs, FEWEST_EACH)) / (2 * FEWEST_EACH)
        return 1.0 if self.complete else min(had, NOT_COMPLETE)

    def over(self, law_valid: bool) -> bool:
        """Return whether the staircase has what it wants, or cannot have it."""
        return (law_valid and self.closed) or self.turns >= MOST_TURNS

    @property
    def in_vain(self) -> InhibitReason:
        """Why it is over without a law."""
        few = self.is_limited and min(self.ups, self.downs) < FEWEST_EACH
        return InhibitReason.STAIRCASE_LIMITED if few else InhibitReason.STAIRCASE_IN_VAIN

    def enough(self, law_valid: bool, limits: StaircaseLimits) -> bool:
        """Return whether the staircase has all landings but the one that closes it."""
        wide = min(self.up_m, self.down_m) >= WIDE * limits.window_m
        many = self._least_known(limits) or min(self.ups, self.downs) >= MANY_EACH
        return law_valid and min(self.ups, self.downs) >= FEWEST_EACH and wide and many

    def turned_to_close(self) -> "Staircase":
        """Return it in the other direction, for the last landing."""
        return self if self.closing else replace(self._turned(), closing=True)

    def stepped(self, position_m: float, limits: StaircaseLimits) -> "Staircase":
        """Return the staircase with its next step, the stem resting at a position, m."""
        stairs = self
        if stairs.direction == 0:
            stairs = replace(stairs, direction=1 if position_m < limits.high_m else -1)
        bound_m = limits.high_m if stairs.direction > 0 else limits.low_m
        left_m = stairs.direction * (bound_m - position_m)
        at_limit_pa = limits.maximum_pa if stairs.direction > 0 else limits.minimum_pa
        if left_m < max(stairs.slide_m, stairs._goes_m(limits)) or left_m <= 0.0:
            stairs = stairs._turned()
        elif stairs.level_pa == at_limit_pa:
            stairs = replace(stairs._turned(), is_limited=True)
        return stairs._next_step(limits)

    def _goes_m(self, limits: StaircaseLimits) -> float:
        """Return how far the next slide is to go."""
        return self._wanted_rise_pa(limits) / self.slope_pa_per_m if self.slide_m and self.slope_pa_per_m else 0.0

    def _turned(self) -> "Staircase":
        """Return it in the other direction."""
        return replace(
            self,
            direction=-self.direction,
            turns=self.turns + 1,
            step_pa=0.0,
            rise_pa=0.0,
            low_pa=0.0,
            slide_m=0.0,
            going_m=0.0,
        )

    def counted(self, outcome: SlideOutcome | None, limits: StaircaseLimits) -> "Staircase":
        """Return it with what the last step did, if that is known now."""
        if outcome is None:
            return self
        against = outcome.direction * (outcome.from_m - outcome.position_m) > SHORTEST * limits.window_m
        against_before = self.against if against or not outcome.moved else 0
        return replace(self._slid(outcome)._answered(outcome, limits), against=against_before + against)

    @property
    def is_reversed(self) -> bool:
        """Whether the stem goes against the pressure."""
        return self.against >= REVERSED_AFTER

    def unanswered(self, limits: StaircaseLimits) -> bool:
        """Return whether the stem has not answered what has always moved it before, or anything."""
        return self.highest_pa - self.lowest_pa >= self.most_pa(limits)

    def most_pa(self, limits: StaircaseLimits) -> float:
        """Return the longest way of the level for which the stem may leave it without an answer."""
        going_on_pa = self.most_up_pa if self.direction > 0 else self.most_down_pa
        needed_pa = (going_on_pa if self.slide_m else 0.0) or self.most_turn_pa
        if needed_pa:
            return UNANSWERED * needed_pa + FIRST_STEP * limits.span_pa
        again_pa = self.high_pa if self.direction == self.slid_direction else 0.0
        return max(self.slope_pa_per_m * limits.stroke_m, self.turn_pa + again_pa) or limits.span_pa

    def _answered(self, outcome: SlideOutcome, limits: StaircaseLimits) -> "Staircase":
        """Return it with the way of the level begun anew, if the stem moved visibly, or its packing gave way."""
        way_m = outcome.direction * (outcome.position_m - outcome.from_m)
        if way_m <= max(ANSWER * limits.window_m, DEVIATIONS * outcome.std_m):
            return self
        at_stop = outcome.moved and not outcome.landing
        level_pa = nan if at_stop else self.level_pa
        return replace(self, lowest_pa=level_pa, highest_pa=level_pa)

    def _slid(self, outcome: SlideOutcome) -> "Staircase":
        """Return it with what a slide has taught, if the last step was one."""
        first = self.slide_m == 0.0  # of a direction: its rise turned friction round, too
        if not outcome.moved:
            return self if first else replace(self, low_pa=max(self.low_pa, self.rise_pa))
        went_m = abs(outcome.position_m - outcome.from_m)
        worth_pa = went_m * self.slope_pa_per_m
        if not first and 0.0 < worth_pa < GAVE_WAY * self.rise_pa:
            if worth_pa < GAVE_WAY * self.step_pa:
                return replace(self, low_pa=max(self.low_pa, self.rise_pa))
            first = True  # the rest of the rise took friction up
        going_m = self.going_m + went_m if outcome.landing and not first else self.going_m
        counted = replace(
            self._having_needed(outcome),
            going_m=going_m,
            up_m=max(self.up_m, going_m) if outcome.direction > 0 else self.up_m,
            down_m=max(self.down_m, going_m) if outcome.direction < 0 else self.down_m,
            ups=self.ups + (outcome.landing and outcome.direction > 0),
            downs=self.downs + (outcome.landing and outcome.direction < 0),
            slide_m=went_m,
            rise_pa=0.0,
            step_pa=0.0,
            closed=self.closed or (self.closing and outcome.landing and not first),
        )
        if first:
            return replace(counted, reversal_pa=self.rise_pa) if self.turns else counted
        high_pa = self.rise_pa if self.high_pa < self.low_pa else min(self.high_pa or self.rise_pa, self.rise_pa)
        slope_pa_per_m = self.rise_pa / went_m
        over_pa = abs(self.level_pa - slope_pa_per_m * outcome.position_m)
        turn_pa = 2.0 * over_pa + self.rise_pa
        return replace(counted, high_pa=high_pa, slope_pa_per_m=slope_pa_per_m, turn_pa=turn_pa)

    def _having_needed(self, outcome: SlideOutcome) -> "Staircase":
        """Return it with how far the level went from slide to slide; the first slide of all tells nothing of that.

        One that goes on where the staircase has turned twice, for the pressure's limit moved nothing, is no turn.
        """
        way_pa, turned = abs(self.level_pa - self.slid_pa), outcome.direction != self.slid_direction
        slid_pa = self.level_pa if outcome.landing else nan
        stairs = replace(self, slid_pa=slid_pa, slid_direction=outcome.direction)
        if turned:  # a NaN is no longer than anything
            return replace(stairs, most_turn_pa=max(self.most_turn_pa, way_pa))
        if outcome.direction > 0:
            return replace(stairs, most_up_pa=max(self.most_up_pa, way_pa))
        return replace(stairs, most_down_pa=max(self.most_down_pa, way_pa))

    def _least_known(self, limits: StaircaseLimits) -> bool:
        """Return whether the least rise that breaks the stem loose in this direction is known well enough."""
        shortest_pa = SHORTEST * limits.window_m * self.slope_pa_per_m
        return 0.0 < self.high_pa <= max(CLOSE * self.low_pa, shortest_pa)

    def _wanted_rise_pa(self, limits: StaircaseLimits) -> float:
        """Return the rise of the next slide after the first of a direction."""
        window_pa = limits.window_m * self.slope_pa_per_m
        if self._least_known(limits):
            wanted_pa = max(
                SURE * self.high_pa, min(window_pa / MOST_SLIDES, LEAP * self.slope_pa_per_m * self.slide_m)
            )
        else:
            low_pa = max(self.low_pa, SHORTEST * window_pa)
            wanted_pa = sqrt(low_pa * self.high_pa) if self.high_pa > low_pa else GROWTH * low_pa
        return wanted_pa if wanted_pa > self.rise_pa else GROWTH * self.rise_pa

    def _next_step(self, limits: StaircaseLimits) -> "Staircase":
        span_pa = limits.span_pa
        if self.slide_m > 0.0 and self.slope_pa_per_m > 0.0:
            step_pa = self._wanted_rise_pa(limits) - self.rise_pa
        elif self.closing or (not self.slide_m and self.reversal_pa and not self.slope_pa_per_m):
            step_pa = FIRST_STEP * span_pa if self.step_pa else NEARLY_TURNED * self.reversal_pa or FIRST_STEP * span_pa
        else:
            step_pa = min(GROWTH * self.step_pa, LARGEST_STEP * span_pa) if self.step_pa else FIRST_STEP * span_pa
        asked_pa = self.level_pa + self.direction * step_pa
        level_pa = clamped(asked_pa, limits.minimum_pa, limits.maximum_pa)
        step_pa = step_pa if level_pa == asked_pa else abs(level_pa - self.level_pa)
        return replace(
            self,
            level_pa=level_pa,
            step_pa=step_pa,
            rise_pa=self.rise_pa + step_pa,
            lowest_pa=min(self.lowest_pa, level_pa),  # a NaN stays one
            highest_pa=max(self.highest_pa, level_pa),
        )

"""The excitation of S3 by slides: a staircase up and down inside the travel window, at any period of the loop.

From the pressure in force, steps in one direction, each after the stem has come to rest:

    first step         2 % of the pressure span; while the stem holds, each step is 1.3 times the last (5 % at the most)
    after a slide      0.9 times the rise that broke the stem loose last, and 5 % of it more while the stem holds: so
                       break-away is found; then 1.05 times that, or more, so that each step is a slide
    at the bound       of the window, or where the next slide would leave it, the staircase turns round

It ends when the landings of both directions give a valid static law, or after `MOST_TURNS`. No alpha and beta are
needed: break-away is found by the ramp of small steps, and nothing is asked for beyond the window and the pressure
limits.
"""

from dataclasses import dataclass, replace

from positioner.estimation.landings.landing_detector import SlideOutcome

FIRST_STEP, LARGEST_STEP = 0.02, 0.05
"""Of the pressure span."""
GROWTH = 1.3
LESS, MORE, SURE = 0.9, 0.05, 1.05
"""Of the rise that broke the stem loose last: asked for next, added while it holds, asked for once less has failed."""
SHORTEST, MOST_SLIDES = 0.025, 8
"""Of the window: shorter slides are not sought; slides over the window, if break-away allows."""
FEWEST_EACH = 4
"""Landings in each direction ..."""
MANY_EACH = 8
"""... with which break-away need not be found in both."""
MOST_TURNS = 6


@dataclass(frozen=True, slots=True)
class StaircaseLimits:
    """What the staircase must stay inside: m, Pa."""

    low_m: float
    high_m: float
    minimum_pa: float
    maximum_pa: float


@dataclass(frozen=True, slots=True)
class Staircase:
    """A staircase under way.

    Attributes:
        level_pa: command.
        direction: of the steps, +1 up, -1 down.
        step_pa: the last step.
        rise_pa: since the stem last moved, or since the staircase turned round.
        sure_pa: first step of the next slide, at first as in the other direction; 0: not known yet.
        least: whether a smaller one has failed in this direction.
        slide_m: length of the last slide.
        ups, downs: landings.
        turns: how often it turned round.
    """

    level_pa: float
    direction: int = 0
    step_pa: float = 0.0
    rise_pa: float = 0.0
    sure_pa: float = 0.0
    least: bool = False
    slide_m: float = 0.0
    ups: int = 0
    downs: int = 0
    turns: int = 0

    @property
    def progress(self) -> float:
        """Landings had of those wanted, 0 to 1."""
        return (min(self.ups, FEWEST_EACH) + min(self.downs, FEWEST_EACH)) / (2 * FEWEST_EACH)

    def over(self, law_valid: bool) -> bool:
        """Return whether the staircase has what it wants, or cannot have it."""
        enough = self.least or min(self.ups, self.downs) >= MANY_EACH
        return (law_valid and self.progress >= 1.0 and enough) or self.turns >= MOST_TURNS

    def after(self, outcome: SlideOutcome | None, position_m: float, limits: StaircaseLimits) -> "Staircase":
        """Return the staircase with its next step, the stem resting at a position, m, after what the last step did."""
        stairs = self if outcome is None else self._counted(outcome, limits.high_m - limits.low_m)
        if stairs.direction == 0:
            stairs = replace(stairs, direction=1 if position_m < limits.high_m else -1)
        bound_m = limits.high_m if stairs.direction > 0 else limits.low_m
        left_m = stairs.direction * (bound_m - position_m)
        at_limit_pa = limits.maximum_pa if stairs.direction > 0 else limits.minimum_pa
        if left_m < stairs.slide_m or left_m <= 0.0 or stairs.level_pa == at_limit_pa:
            stairs = replace(
                stairs,
                direction=-stairs.direction,
                turns=stairs.turns + 1,
                step_pa=0.0,
                rise_pa=0.0,
                least=False,
                slide_m=0.0,
            )
        return stairs._stepped(limits)

    def _counted(self, outcome: SlideOutcome, window_m: float) -> "Staircase":
        if not outcome.moved:
            return self
        went_m = abs(outcome.position_m - outcome.from_m)
        sure_pa, least = self._sure_pa(went_m, window_m)
        return replace(
            self,
            ups=self.ups + (outcome.landing and outcome.direction > 0),
            downs=self.downs + (outcome.landing and outcome.direction < 0),
            sure_pa=sure_pa,
            least=least,
            slide_m=went_m,
            rise_pa=0.0,
            step_pa=0.0,
        )

    def _sure_pa(self, went_m: float, window_m: float) -> tuple[float, bool]:
        """Return the first step of the next slide, and whether it is known that less would not do."""
        if self.slide_m == 0.0:  # the first slide of a direction: its rise turned friction round, too
            return self.sure_pa, False
        least = self.least or self.rise_pa > self.sure_pa > 0.0 or went_m < SHORTEST * window_m
        wanted_m = max(SURE * went_m, window_m / MOST_SLIDES) if least else LESS * went_m
        return wanted_m * self.rise_pa / went_m, least

    def _stepped(self, limits: StaircaseLimits) -> "Staircase":
        span_pa = limits.maximum_pa - limits.minimum_pa
        if self.sure_pa > 0.0 and self.slide_m > 0.0:
            step_pa = MORE * self.sure_pa if self.step_pa else self.sure_pa
        else:
            step_pa = min(GROWTH * self.step_pa, LARGEST_STEP * span_pa) if self.step_pa else FIRST_STEP * span_pa
        level_pa = min(max(self.level_pa + self.direction * step_pa, limits.minimum_pa), limits.maximum_pa)
        return replace(self, level_pa=level_pa, step_pa=step_pa, rise_pa=self.rise_pa + step_pa)

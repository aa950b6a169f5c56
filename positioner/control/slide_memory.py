"""The memory of the law of slides: the move, the slide in progress, and how far a stem at rest must be sent."""

from dataclasses import dataclass, replace
from math import inf, nan

from config.codes import InhibitReason
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.stem_at_rest import Rest

MARGIN_RAISE, MARGIN_LOWER = 1.06, 0.999
"""Factors on a margin after a slide that did not break loose, and after one that did."""
MARGIN_CLIMB, MARGIN_DESCEND = 1.3, 0.85
"""The same as long as no slide has done either."""
MARGIN_LENGTHEN, SHORT = 1.2, 2.0
"""Factor after a short slide that missed its aim; margins up to which a slide is short."""
DAY_S = 86400.0
NEAR = 1.1
"""Margins: a slide longer than this says nothing of the margin."""


@dataclass(frozen=True, slots=True)
class SlideSettings:
    """Settings of the law: m, Pa, s."""

    stroke_m: float
    dead_band_m: float
    minimum_pa: float
    maximum_pa: float
    breakaway_pa: float | None
    """F_s/A where it is known."""
    excursion_limit_m: float
    excursion_interval_s: float
    """Least time between two excursions."""
    budget_m_per_s: float = 0.0
    """Travel that excursions may cost, of which a day's may be spent at once; 0: no limit."""
    command_step_pa: float = 0.0
    """The least difference of two commands that the device is told."""


@dataclass(frozen=True, slots=True)
class StemObservation:
    """What one step sees: m, s. `rest` is None while the stem moves or may yet move."""

    now_s: float
    position_m: float
    usable: bool
    rest: Rest | None
    quantum_m: float
    outcome: SlideOutcome | None
    """Of the last change of the command, in the step in which it is known."""


@dataclass(frozen=True, slots=True)
class Margin:
    """The shortest slide that breaks loose in one direction: (F_s - F_c)/k_s as learnt, m."""

    way_m: float = 0.0
    """0: unknown."""
    broke: bool = False
    held: bool = False
    """Whether a slide about as long has broken loose, and whether one has not."""

    def after(self, way_m: float, moved: bool) -> "Margin":
        """Return the margin after a slide meant to go a way, m."""
        if moved:
            shorter = min(self.way_m, way_m) if self.way_m else way_m
            lower = (MARGIN_LOWER if self.held else MARGIN_DESCEND) if way_m <= NEAR * shorter else 1.0
            return Margin(lower * shorter, True, self.held)
        if way_m < self.way_m / NEAR:
            return self
        return Margin((MARGIN_RAISE if self.broke else MARGIN_CLIMB) * max(way_m, self.way_m), self.broke, True)

    def after_miss(self, way_m: float) -> "Margin":
        """Return the margin after a slide of a way, m, that landed far from its aim: longer, if it was short."""
        if way_m > SHORT * self.way_m:
            return self
        return Margin(MARGIN_LENGTHEN * max(way_m, self.way_m), self.broke, True)


@dataclass(frozen=True, slots=True)
class SlideMemory:
    """What the law remembers from one step to the next."""

    level_pa: float = 0.0
    target_m: float | None = None
    """None while another state commands."""
    direction: int = 0
    """Of the slide in progress."""
    excursion: bool = False
    """Whether it is the first of two."""
    return_pa: float = nan
    """The pressure of the second of two, from where the first was to land."""
    slides: int = 0
    """Given since the reference changed ..."""
    slide_s: float = -inf
    """... and when the last was."""
    last_m: float = nan
    """The sample before."""
    up: Margin = Margin()
    down: Margin = Margin()
    margins_at_m: float = nan
    """Where the margins are those of the extended valve; nan: none is known."""
    excursion_s: float = -inf
    """When the last excursion began ..."""
    spent_m: float = 0.0
    """... and what was spent then of a day's travel."""
    inhibit_reason: InhibitReason = InhibitReason.NOTHING

    def held_pa(self, command_pa: float) -> float:
        """Return what to hold when something interrupts after a command, Pa: of two slides the second."""
        return self.return_pa if self.excursion else command_pa

    def margin(self, direction: int) -> Margin:
        """Return the margin in a direction."""
        return self.up if direction > 0 else self.down

    def spent_at_m(self, now_s: float, settings: SlideSettings) -> float:
        """Return what is spent now of a day's travel, m: what has come back since is taken off."""
        back_m = settings.budget_m_per_s * (now_s - self.excursion_s) if self.spent_m else 0.0
        return max(0.0, self.spent_m - back_m)

    def with_margin(self, direction: int, margin: Margin) -> "SlideMemory":
        """Return the memory with another margin in a direction."""
        return replace(self, up=margin) if direction > 0 else replace(self, down=margin)

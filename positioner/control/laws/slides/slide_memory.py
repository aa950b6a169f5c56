"""The memory of the law of slides: the move, the slide in progress, and how far a stem at rest must be sent."""

from dataclasses import dataclass, replace
from math import inf, isnan, nan
from typing import TYPE_CHECKING, ClassVar, Self

from config.codes import InhibitReason
from config.daemon_file import DaemonFile
from positioner.control.laws.slides.reference_course import ReferenceCourse
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.slide_margins import NO_MARGINS, Margin, Margins
from positioner.estimation.landings.stem_at_rest import Rest

if TYPE_CHECKING:
    from positioner.control.laws.slides.law import SlideLaw

DAY_S = 86400.0
CREEP = 0.03
"""Of the stroke: a packing gives way no farther."""


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

    by_single_steps: ClassVar[bool] = True

    @classmethod
    def of(cls, file: DaemonFile) -> Self:
        """Return what a daemon's file says of the law."""
        stroke_m, control = file.valve.stroke_m, file.control
        return cls(
            stroke_m=stroke_m,
            dead_band_m=control.dead_band * stroke_m,
            minimum_pa=file.pressure.minimum_pa,
            maximum_pa=file.pressure.maximum_pa,
            breakaway_pa=file.valve.breakaway_pa,
            excursion_limit_m=control.excursion_limit * stroke_m,
            excursion_interval_s=control.excursion_interval_s,
            budget_m_per_s=control.excursion_budget_strokes_per_day * stroke_m / DAY_S,
            command_step_pa=file.device.command_step_pa,
        )

    def begin(self, held_pa: float) -> "SlideLaw":
        """Return the law under a command, Pa."""
        from positioner.control.laws.slides.law import SlideLaw

        return SlideLaw(self, SlideMemory(level_pa=held_pa))


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
    waits_for: InhibitReason = InhibitReason.NOTHING
    """Why it should long have come to rest, and no rest counts."""


@dataclass(frozen=True, slots=True)
class Anchor:
    """Where the last slide ended, m, and its direction, 0: not known. A packing that gives way does not change it."""

    position_m: float = nan
    direction: int = 0

    def at(self, rest_m: float, stroke_m: float) -> "Anchor":
        """Return the anchor of a stem that rests at a position, m: if it lies far off, something else has moved it."""
        return self if abs(rest_m - self.position_m) <= CREEP * stroke_m else Anchor(rest_m)


@dataclass(frozen=True, slots=True)
class Held:
    """Slides in a row that did not break the stem loose, each as long as has, and what was known before the first."""

    slides: int = 0
    margins: Margins = NO_MARGINS
    """Before the first: what slides teach that all held is a friction that no slide has overcome."""
    at_m: float = nan
    """Where the stem was found stuck; nan: it was not. It is until a slide breaks it loose, or it is seen elsewhere."""
    surely: int = 0
    """Those of the slides that were as long as has been seen to break it loose; the others, as a guess says."""

    @property
    def stuck(self) -> bool:
        """Whether the stem was found stuck, and has not been seen to move since."""
        return not isnan(self.at_m)

    def one_more(self, margins: Margins, *, surely: bool) -> "Held":
        """Return the row with one more slide, before which margins were known."""
        margins = self.margins if self.slides else margins
        return replace(self, slides=self.slides + 1, surely=self.surely + surely, margins=margins)


NOWHERE, NO_COURSE, NONE_HELD = Anchor(), ReferenceCourse(), Held()


@dataclass(frozen=True, slots=True)
class SlideMemory:
    """What the law remembers from one step to the next."""

    level_pa: float = 0.0
    target_m: float | None = None
    """None while another state commands."""
    course: ReferenceCourse = NO_COURSE
    """Of the references until now."""
    direction: int = 0
    """Of the slide in progress."""
    excursion: bool = False
    """Whether it is the first of two."""
    return_pa: float = nan
    """What is held if something interrupts the first of two: under it the stem comes back."""
    aim_m: float = nan
    """Where the slide in progress is to land; nan where the pressure limits do not let it."""
    anchor: Anchor = NOWHERE
    """Where the last slide ended."""
    slides: int = 0
    """Given since the reference changed ..."""
    slide_s: float = -inf
    """... and when the last was."""
    last_m: float = nan
    """Of the first of two, where the stem was a while before ..."""
    last_s: float = -inf
    """... and when."""
    margins: Margins = NO_MARGINS
    held: Held = NONE_HELD
    """Of the last slides, those that broke nothing loose."""
    margins_at_m: float = nan
    """Where the margins are those of the extended valve; nan: none is known."""
    excursion_s: float = -inf
    """When the last excursion began ..."""
    away_s: float = 0.0
    """... how long the last that came back took until its second slide ..."""
    spent_m: float = 0.0
    """... and what was spent then of a day's travel."""
    inhibit_reason: InhibitReason = InhibitReason.NOTHING

    def asked(self, now_s: float, reference_m: float) -> "SlideMemory":
        """Return the memory with a reference, m: where it is another one, slides are counted anew."""
        if reference_m == self.course.value_m:
            return self
        return replace(self, course=self.course.after(now_s, reference_m), slides=0)

    @property
    def learnt(self) -> Margins:
        """The margins without what slides seem to teach of which none has yet broken loose."""
        return self.held.margins if self.held.slides else self.margins

    def held_pa(self, command_pa: float) -> float:
        """Return what to hold when something interrupts after a command, Pa: of two slides the second."""
        return self.return_pa if self.excursion else command_pa

    def margin(self, direction: int) -> Margin:
        """Return the margin of the next slide in a direction from where the stem stands."""
        return self.margins.of(direction, turning=direction != self.anchor.direction)

    def spent_at_m(self, now_s: float, settings: SlideSettings) -> float:
        """Return what is spent now of a day's travel, m: what has come back since is taken off."""
        back_m = settings.budget_m_per_s * (now_s - self.excursion_s) if self.spent_m else 0.0
        return max(0.0, self.spent_m - back_m)

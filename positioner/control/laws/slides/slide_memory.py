"""What the law of slides remembers beside its state: of the stem, of the move, and of what excursion has cost."""

from dataclasses import dataclass, replace

from config.codes import InhibitReason
from positioner.control.laws.slides.reference_course import ReferenceCourse
from positioner.control.laws.slides.slide_bounds import SlideBounds
from positioner.control.laws.slides.slide_states import WATCHING, Idle, Slide, State, Watching
from positioner.estimation.landings.breakaway_distance import BreakawayDistance


@dataclass(frozen=True, slots=True)
class Anchor:
    """Where the last slide ended, m, and its direction. A packing that gives way does not change it."""

    position_m: float
    direction: int

    def turns(self, direction: int) -> bool:
        """Whether a slide in a direction would turn round."""
        return direction != self.direction


@dataclass(frozen=True, slots=True)
class Move:
    """The slides for one reference."""

    left: int
    """That may still be given."""
    landed: int = 0
    """That broke loose, and landed elsewhere than they should, or were the first of two."""
    given_s: float | None = None
    """When the last was."""
    last: Slide | None = None
    """The last one, if it was sent to the reference."""
    preslid: int = 0
    """Direct moves of it."""
    held: bool = False
    """Whether one of it has held: then the next is as long as has surely broken loose."""

    def given(self, now_s: float, last: Slide | None) -> "Move":
        """Return it with one more slide."""
        return replace(self, left=self.left - 1, landed=self.landed + 1, given_s=now_s, last=last)

    def refilled(self, now_s: float, bounds: SlideBounds) -> "Move":
        """Return it with what has come back of its slides."""
        thresholds = bounds.thresholds
        if self.given_s is None or self.left >= thresholds.most_slides:
            return self
        times = int((now_s - self.given_s) / thresholds.refill_s)
        if not times:
            return self
        left = min(thresholds.most_slides, self.left + 2 * times)
        return replace(self, left=left, given_s=self.given_s + times * thresholds.refill_s)


@dataclass(frozen=True, slots=True)
class Row:
    """Slides in a row that did not break the stem loose, each as long as has, and what was known before the first.

    What slides teach that all held is a friction that no slide has overcome.
    """

    before: BreakawayDistance
    held: int = 0
    stuck_at_m: float | None = None
    """Where the stem was found stuck. It is until a slide breaks it loose, or it is seen elsewhere: in any state."""


@dataclass(frozen=True, slots=True)
class Excursions:
    """When the last one began, s, how long the last that came back took, and what was spent of a day's travel, m."""

    begun_s: float
    away_s: float = 0.0
    spent_m: float = 0.0

    def spent_at_m(self, now_s: float, bounds: SlideBounds) -> float:
        """Return what is spent now of a day's travel, m: what has come back since is taken off."""
        return max(0.0, self.spent_m - bounds.budget_m_per_s * (now_s - self.begun_s))


@dataclass(frozen=True, slots=True, kw_only=True)
class SlideMemory:
    """All that the law remembers from one step to the next."""

    command_pa: float
    """In force, Pa."""
    move: Move
    state: State = WATCHING
    target_m: float | None = None
    """What the move is to; None while another state commands."""
    course: ReferenceCourse | None = None
    """Of the references until now."""
    distances: BreakawayDistance | None = None
    """How far the stem must be sent to break loose; None before anything of the valve is known."""
    row: Row | None = None
    anchor: Anchor | None = None
    """None: not known, for something else has moved the stem."""
    excursions: Excursions | None = None

    def inhibit_reason(self) -> InhibitReason:
        """Return why the stem is off its reference; of a stuck one no other reason matters."""
        if isinstance(self.state, Watching) or self.state == Idle():
            return InhibitReason.NOTHING
        return InhibitReason.STUCK if self.stuck_at_m is not None else self.state.reason

    def stands(self, now_s: float, bounds: SlideBounds) -> bool:
        """Whether a plan that finds nothing to do finds nothing later: no wait, no references and no slides come."""
        waits = isinstance(self.state, Idle) and self.state.waits
        comes = self.course is not None and not self.course.rests(now_s)
        return not (waits or comes) and self.move.refilled(now_s, bounds) is self.move

    @property
    def stuck_at_m(self) -> float | None:
        """Where the stem is stuck, m; None: it is not."""
        return None if self.row is None else self.row.stuck_at_m

    @property
    def learnt(self) -> BreakawayDistance | None:
        """The distances without what slides seem to teach of which none has yet broken loose."""
        return self.distances if self.row is None else self.row.before

    def anchor_at(self, rest_m: float, bounds: SlideBounds) -> Anchor | None:
        """Return where the last slide ended, of a stem that rests at a place, m: far off, something else moved it."""
        anchor = self.anchor
        return None if anchor is None or abs(rest_m - anchor.position_m) > bounds.longest_giving_m else anchor

"""The states of the law of slides: a type each, with what it needs and nothing else.

    Watching      another state commands
    Idle          nothing is under way; why not, if the stem is off its reference
    Sliding       one slide, on its way to the reference
    Out           the first of two: an excursion, beyond the reference or short of it
    Returning     the second of two
    Presliding    its packing gives way under the stem, which is moved directly
    Waiting       the stem does not come to rest, or not under the pressure commanded
    Stuck         nothing breaks it loose

Which follows which: `transitions.py`.
"""

from dataclasses import dataclass

from config.codes import InhibitReason


@dataclass(frozen=True, slots=True, kw_only=True)
class Slide:
    """A slide that was given from rest: m, s."""

    from_m: float
    to_m: float
    direction: int
    turning: bool | None
    """Whether it turns round; None: in which direction the last one went is not known."""

    @property
    def way_m(self) -> float:
        """How far it is sent."""
        return self.direction * (self.to_m - self.from_m)

    def went_m(self, position_m: float) -> float:
        """Return how far it has gone, m."""
        return self.direction * (position_m - self.from_m)


@dataclass(frozen=True, slots=True)
class Watching:
    """Another state commands, the law only watches."""


@dataclass(frozen=True, slots=True)
class Idle:
    """Nothing is under way, for a reason, or because the stem is where it shall be."""

    reason: InhibitReason = InhibitReason.NOTHING


@dataclass(frozen=True, slots=True)
class Sliding:
    """One slide; None: given while the stem moved, or cut short by a limit of the pressure: it teaches nothing."""

    slide: Slide | None
    reason: InhibitReason = InhibitReason.NOTHING


@dataclass(frozen=True, slots=True, kw_only=True)
class Out:
    """The first of two slides, an excursion: where it turns, where the stem was a while ago, what brings it back."""

    slide: Slide
    given_s: float
    seen_m: float
    seen_s: float
    back_pa: float
    """What is held if something interrupts: under it the stem comes back."""
    reason: InhibitReason = InhibitReason.NOTHING
    """Why it does not come to rest."""


@dataclass(frozen=True, slots=True)
class Returning:
    """The second of two slides; None: cut short by a limit of the pressure."""

    slide: Slide | None
    reason: InhibitReason = InhibitReason.NOTHING


@dataclass(frozen=True, slots=True)
class Presliding:
    """The stem is moved directly, as far as its packing gives way."""

    to_m: float
    """Where it is to stand."""
    loose: Slide
    """The slide that it is if it breaks loose."""
    reason: InhibitReason = InhibitReason.PRESLIDING


@dataclass(frozen=True, slots=True)
class Waiting:
    """The stem is off its reference and does not come to rest, or not under what is commanded; a slide may be on."""

    slide: Slide | None
    reason: InhibitReason


@dataclass(frozen=True, slots=True)
class Stuck:
    """No slide that a bound allows breaks the stem loose."""


WATCHING, STUCK = Watching(), Stuck()
State = Watching | Idle | Sliding | Out | Returning | Presliding | Waiting | Stuck
STATES: tuple[type[State], ...] = (Watching, Idle, Sliding, Out, Returning, Presliding, Waiting, Stuck)


def slide_of(state: State) -> Slide | None:
    """Return the slide under way, of which an outcome may tell something."""
    return None if isinstance(state, Watching | Idle | Presliding | Stuck) else state.slide

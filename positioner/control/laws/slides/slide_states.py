"""The states of the law of slides: a type each, with what it needs and nothing else.

    Watching      another state of the daemon commands
    Idle          nothing is under way
    Sliding       a slide to the reference: the only one, or the second of two
    Out           the first of two: an excursion, beyond the reference or short of it
    Presliding    its packing gives way under the stem, which is moved directly

Each but the first has a reason why the stem is off its reference: of one under way, why it does not come to rest. Which
follows which: `transitions.py`.
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
    waits: bool = False
    """Whether the reason ends by time alone."""


@dataclass(frozen=True, slots=True)
class Sliding:
    """A slide; None: given while the stem moved, or cut short by a limit of the pressure: it teaches nothing."""

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


@dataclass(frozen=True, slots=True)
class Presliding:
    """The stem is moved directly, as far as its packing gives way."""

    to_m: float
    """Where it is to stand."""
    loose: Slide
    """The slide that it is if it breaks loose."""
    reason: InhibitReason = InhibitReason.PRESLIDING


WATCHING = Watching()
State = Watching | Idle | Sliding | Out | Presliding


def slide_of(state: State) -> Slide | None:
    """Return the slide under way, of which an outcome may tell something."""
    return state.slide if isinstance(state, Sliding | Out) else None

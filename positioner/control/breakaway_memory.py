"""The memory of the law for small moves: the rest, the move, the pulse in progress, and what pulses have taught."""

from dataclasses import dataclass, replace
from math import inf

from config.codes import InhibitReason
from positioner.control.pulse import Pulse, PulseResponse, unidentified_response
from positioner.control.rest_detector import RestEstimate
from positioner.estimation.acceptance import Ratios

RESOLUTION = 2e-4
"""Of the stroke: to this a position at rest is averaged."""


@dataclass(frozen=True, slots=True)
class BreakawaySettings:
    """Settings of the law: m, Pa."""

    stroke_m: float
    dead_band_m: float
    minimum_pa: float
    maximum_pa: float
    breakaway_pa: float | None
    """F_s/A where it is known."""
    push_limit_pa: float | None
    """The most that a push may be beyond the balance; None: F_c/A as identified."""


@dataclass(frozen=True, slots=True)
class Observation:
    """The measurement of one step, SI units. `usable` says whether the position may be used."""

    now_s: float
    position_m: float
    pressure_pa: float
    usable: bool


@dataclass(frozen=True, slots=True)
class PulseTrial:
    """A pulse given to learn from: the rest it started at, m, and how far the shortest pulse would have gone, m."""

    pulse: Pulse
    from_m: float
    from_error_m: float
    shortest_m: float
    arrived: bool = False
    """Whether the pressure has reached the push."""


@dataclass(frozen=True, slots=True)
class PulseInProgress:
    """The stem moves, or may move: the pressures of push and hold, and when it should be at rest."""

    push_pa: float
    hold_pa: float
    start_s: float
    settle_s: float
    """Delay from the end of the push until its effect is in the samples ..."""
    glide_s: float
    """... and from there until the stem is predicted to rest."""
    push_end_s: float = inf
    """Infinite while it is pushed."""
    first_gap: tuple[float, float] | None = None
    """Time, s, and gap between pressure and hold, Pa, when the outcome began to show."""
    lag_known: bool = False
    trial: PulseTrial | None = None
    """None: nothing can be learnt from this pulse, for the reference changed meanwhile."""


@dataclass(frozen=True, slots=True)
class LearntPush:
    """The push in one direction beyond the balance as learnt, m, and whether such a pulse ever moved the stem."""

    push_m: float
    moved: bool


UNTRIED_PUSH, UNKNOWN_RESPONSE = LearntPush(0.0, False), unidentified_response(0.0)


@dataclass(frozen=True, slots=True)
class Move:
    """A move since the reference changed."""

    target_m: float
    pulses: int = 0
    reversals: int = 0
    direction: int = 0
    at_limit: int = 0
    """Pulses at the limit, in a row, that moved nothing."""
    ended_s: float | None = None
    ended_at_m: float = 0.0


@dataclass(frozen=True, slots=True)
class BreakawayMemory:
    """What the law remembers from one step to the next."""

    rest: RestEstimate
    ratios: Ratios | None = None
    response: PulseResponse = UNKNOWN_RESPONSE
    up: LearntPush = UNTRIED_PUSH
    down: LearntPush = UNTRIED_PUSH
    slow_pressure: bool = False
    lag_s: float = 0.0
    """Of the pressure, when it is slow; 0: not measured."""
    now_s: float = 0.0
    level_pa: float = 0.0
    move: Move | None = None
    """None while another state commands."""
    in_progress: PulseInProgress | None = None
    inhibit_reason: InhibitReason = InhibitReason.NOTHING

    def held_pa(self, command_pa: float) -> float:
        """Return what to hold when something interrupts after a command, Pa: what a push would have given way to."""
        pushing = self.in_progress is not None and self.in_progress.push_end_s == inf
        return self.in_progress.hold_pa if self.in_progress is not None and pushing else command_pa

    def push_in(self, direction: int) -> LearntPush:
        """Return the push in a direction."""
        return self.up if direction > 0 else self.down

    def with_push_in(self, direction: int, push: LearntPush) -> "BreakawayMemory":
        """Return the memory with another push in a direction."""
        return replace(self, up=push) if direction > 0 else replace(self, down=push)


def initial_memory(settings: BreakawaySettings) -> BreakawayMemory:
    """Return the memory of a law that has no measurement yet."""
    return BreakawayMemory(RestEstimate(RESOLUTION * settings.stroke_m))

"""The law with a memory that is in force, whichever it is: its settings, its memory, one step of it.

A law without a memory is a function (`settings.LAWS`); these remember a move, and what moves have taught.
"""

from dataclasses import dataclass, replace

from config.extended_valve import ExtendedValve
from positioner.control import breakaway_law as breakaway
from positioner.control import conventional_law as conventional
from positioner.control import move_law as moves
from positioner.control import slide_law as slides
from positioner.control.breakaway_memory import BreakawayMemory, BreakawaySettings, Observation, initial_memory
from positioner.control.conventional_law import ConventionalMemory, ConventionalSettings
from positioner.control.margins_over_travel import with_margins_at
from positioner.control.move_memory import MoveMemory, MoveSettings
from positioner.control.sample import Sample
from positioner.control.slide_balance import Balance
from positioner.control.slide_inverse import stem_observed
from positioner.control.slide_memory import SlideMemory, SlideSettings, StemObservation
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Estimates
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification

LawSettings = MoveSettings | BreakawaySettings | SlideSettings | ConventionalSettings
LawMemory = MoveMemory | BreakawayMemory | SlideMemory | ConventionalMemory

_WITH_A_PUSH = (MoveMemory, BreakawayMemory, SlideMemory)
"""Whose command may be one that something else is to follow."""


@dataclass(frozen=True, slots=True)
class LawInput:
    """What a law may use in one step, SI units."""

    sample: Sample
    usable: bool
    """Whether the sample is new and could be true."""
    command_pa: float
    """The last command given."""
    reference_m: float
    ratios: Ratios | None
    """None: another state commands, the law only watches."""
    estimates: Estimates
    outcome: SlideOutcome | None
    """Of the last change of the command, in the step in which it is known."""
    statics: StaticIdentification
    stroke_m: float
    valve: ExtendedValve | None
    """Whose effects are known."""
    provisional: bool = False
    """Whether the first landings have still to tell that what is known of the valve holds."""


def first_memory(settings: LawSettings | None, held_pa: float) -> LawMemory | None:
    """Return the memory of the law before its first step; None for a law without one."""
    match settings:
        case MoveSettings():
            return MoveMemory(initial_memory(settings.pulses), SlideMemory(level_pa=held_pa))
        case BreakawaySettings():
            return initial_memory(settings)
        case SlideSettings():
            return SlideMemory(level_pa=held_pa)
        case ConventionalSettings():
            return ConventionalMemory(level_pa=held_pa)
        case None:
            return None


def after_step(memory: LawMemory, settings: LawSettings | None, seen: LawInput) -> LawMemory | None:
    """Return what the law remembers after one step; its `level_pa` is the pressure it asks for."""
    match memory, settings:
        case MoveMemory(), MoveSettings():
            return _after_moves(memory, settings, seen)
        case BreakawayMemory(), BreakawaySettings():
            return _after_pulses(memory, settings, seen)
        case SlideMemory(), SlideSettings():
            return _after_slides(memory, settings, seen)
        case ConventionalMemory(), ConventionalSettings():
            return _after_conventional(memory, settings, seen)
        case _:
            return None


def held_pa(memory: LawMemory | None, command_pa: float) -> float:
    """Return what to hold when something interrupts the law after a command, Pa: what follows a push, an excursion."""
    return memory.held_pa(command_pa) if isinstance(memory, _WITH_A_PUSH) else command_pa


def _after_moves(memory: MoveMemory, settings: MoveSettings, seen: LawInput) -> MoveMemory:
    sampled = _sampled(seen)
    if seen.ratios is None:
        return moves.while_not_commanding(memory, sampled, seen.command_pa)
    observation = _observed(seen)
    if seen.valve is not None:
        sampled = replace(sampled, position_m=observation.position_m)
    balance = _balance(seen, seen.ratios)
    memory = replace(memory, slides=with_margins_at(memory.slides, seen.reference_m, balance))
    reference_m, allowed = seen.reference_m, not seen.provisional
    return moves.step(
        memory, sampled, observation, reference_m, balance, seen.estimates, settings, pulses_allowed=allowed
    )


def _after_pulses(memory: BreakawayMemory, settings: BreakawaySettings, seen: LawInput) -> BreakawayMemory:
    observation = _sampled(seen)
    if seen.ratios is None:
        return breakaway.while_not_commanding(memory, observation, seen.command_pa)
    return breakaway.step(memory, observation, seen.reference_m, seen.ratios, seen.estimates, settings)


def _after_slides(memory: SlideMemory, settings: SlideSettings, seen: LawInput) -> SlideMemory:
    if seen.ratios is None:
        return slides.while_not_commanding(memory, seen.command_pa)
    balance = _balance(seen, seen.ratios)
    memory = with_margins_at(memory, seen.reference_m, balance)
    return slides.step(memory, _observed(seen), seen.reference_m, balance, settings)


def _sampled(seen: LawInput) -> Observation:
    sample = seen.sample
    return Observation(sample.now_s, sample.position_m, sample.pressure_pa, seen.usable)


def _observed(seen: LawInput) -> StemObservation:
    detector = seen.statics.detector
    observation = StemObservation(
        now_s=seen.sample.now_s,
        position_m=seen.sample.position_m,
        usable=seen.usable,
        rest=detector.rest,
        quantum_m=detector.quantum_m,
        outcome=seen.outcome,
        waits_for=detector.waits_for,
    )
    return observation if seen.valve is None else stem_observed(observation, seen.valve, seen.statics.way)


def _balance(seen: LawInput, ratios: Ratios) -> Balance:
    statics = seen.statics
    return Balance(
        ratios,
        statics.balances,
        statics.held,
        seen.stroke_m,
        statics.valve,
        seen.sample.now_s,
        statics.law.swing if statics.valve is None else 0.0,
    )


def _after_conventional(
    memory: ConventionalMemory, settings: ConventionalSettings, seen: LawInput
) -> ConventionalMemory:
    if seen.ratios is None:
        return conventional.while_not_commanding(seen.command_pa)
    if not seen.usable:
        return memory
    error_m = seen.reference_m - seen.sample.position_m
    return conventional.step(memory, seen.sample.now_s, error_m, seen.ratios, settings)

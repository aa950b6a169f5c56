"""The law of slides: a stem that slides into rest lands where spring and friction balance, however slow the loop.

What it does at rest is in `plan.py`, which state follows which in `transitions.py`. Only resting times depend on the
period of the loop, not where the stem lands.

While references keep coming, one slide lands ahead of a ramp, and two are given only for an error that the coming ones
do not take back (`reference_course.py`).
"""

from dataclasses import dataclass, replace
from operator import is_
from typing import ClassVar, NamedTuple, Self

from config.codes import InhibitReason
from config.daemon_file import DaemonFile
from positioner.control.laws.boundary import Seen
from positioner.control.laws.slides.now import Now
from positioner.control.laws.slides.reference_course import ReferenceCourse
from positioner.control.laws.slides.slide_bounds import DAY_S, SlideBounds
from positioner.control.laws.slides.slide_memory import Move, SlideMemory
from positioner.control.laws.slides.slide_pressure import Balance
from positioner.control.laws.slides.slide_states import Idle, Out, Watching
from positioner.control.laws.slides.teaching import after_outcome
from positioner.control.laws.slides.transitions import after
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.estimation.landings.stem_at_rest import Rest


@dataclass(frozen=True, slots=True, kw_only=True)
class SlideSettings(SlideBounds):
    """Settings of the law: what the site sets, and thresholds."""

    by_single_steps: ClassVar[bool] = True

    @classmethod
    def of(cls, file: DaemonFile, /) -> Self:
        """Return what a daemon's file says of the law."""
        stroke_m, control = file.valve.stroke_m, file.control
        return cls(
            stroke_m=stroke_m,
            dead_band_m=control.least_dead_band * stroke_m,
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
        move = Move(self.thresholds.most_slides)
        return SlideLaw(settings=self, memory=SlideMemory(command_pa=held_pa, move=move))


@dataclass(frozen=True, slots=True)
class SlideLaw:
    """The law with what it remembers."""

    settings: SlideSettings
    memory: SlideMemory
    balance: Balance | None = None
    """By which it last commanded."""
    planned: "Planned | None" = None
    """By what it last found nothing to do, whatever the time; None: it plans at each sample."""

    @property
    def command_pa(self) -> float:
        """The pressure that it asks for, Pa."""
        return self.memory.command_pa

    @property
    def inhibit_reason(self) -> InhibitReason:
        """Why the stem is not where it shall be."""
        return self.memory.inhibit_reason()

    def observe(self, seen: Seen) -> "SlideLaw":
        """Return the law after one sample."""
        memory, settings, balance, planned = self.memory, self.settings, self.balance, self.planned
        if seen.dead_band_m != settings.dead_band_m:
            settings = replace(settings, dead_band_m=seen.dead_band_m)
        if seen.ratios is None:
            memory, planned = let_go(memory, seen.command_pa, settings), None
        elif seen.usable:
            balance = balance_after(balance, seen.ratios, seen, settings.stroke_m)
            planned = Planned.of(seen, balance, settings)
            stands = memory.stands(seen.sample.now_s, settings)
            if planned is None or planned != self.planned or not stands:
                memory = stepped(memory, Now.of(seen, balance, settings))
            planned = planned if stands and memory is self.memory else None
        if memory is self.memory and settings is self.settings and balance is self.balance and planned == self.planned:
            return self
        return SlideLaw(settings, memory, balance, planned)

    def interrupted_pa(self, command_pa: float) -> float:
        """Return what to hold if something interrupts it after a command, Pa: of two slides the second."""
        state = self.memory.state
        return state.back_pa if isinstance(state, Out) else command_pa

    def known(self, knowledge: ValveKnowledge, _statics: StaticIdentification, /) -> ValveKnowledge:
        """Return what is known of the valve with the break-away distances."""
        return replace(knowledge, distances=self.memory.learnt)

    def restored(self, knowledge: ValveKnowledge, /) -> "SlideLaw":
        """Return the law with the break-away distances of before a restart."""
        return SlideLaw(self.settings, replace(self.memory, distances=knowledge.distances))


class Planned(NamedTuple):
    """What a plan at rest is made by, beside the law's memory and the time."""

    rest: Rest
    quantum_m: float
    reference_m: float
    balance: Balance
    settings: SlideSettings

    @classmethod
    def of(cls, seen: Seen, balance: Balance, settings: SlideSettings) -> "Planned | None":
        """Return it of a sample; None where the stem does not rest."""
        detector = seen.statics.detector
        if detector.rest is None:
            return None
        return cls(
            rest=detector.rest,
            quantum_m=detector.quantum_m,
            reference_m=seen.reference_m,
            balance=balance,
            settings=settings,
        )


def let_go(memory: SlideMemory, command_pa: float, bounds: SlideBounds) -> SlideMemory:
    """Return the memory while another state commands: nothing of a move, nor of what seems to hold the stem."""
    if isinstance(memory.state, Watching) and memory.command_pa == command_pa:
        return memory
    return SlideMemory(
        command_pa=command_pa,
        move=Move(bounds.thresholds.most_slides),
        course=memory.course,
        distances=memory.learnt,
        excursions=memory.excursions,
    )


def stepped(memory: SlideMemory, now: Now) -> SlideMemory:
    """Return what is remembered after one step in which the law commands."""
    bounds, reference_m = now.bounds, now.reference_m
    if memory.distances is None:
        memory = replace(memory, distances=now.balance.first_distances(bounds.breakaway_pa))
    if isinstance(memory.state, Watching):
        memory = replace(memory, state=Idle())
    if memory.course is None:
        memory = replace(memory, course=ReferenceCourse(reference_m, now.now_s))
    elif reference_m != memory.course.value_m:
        move = Move(bounds.thresholds.most_slides)
        memory = replace(memory, course=memory.course.after(now.now_s, reference_m), move=move)
    if now.outcome is not None:
        memory = after_outcome(memory, now.outcome, now)
    return after(memory, now)


def balance_after(before: Balance | None, ratios: Ratios, seen: Seen, stroke_m: float) -> Balance:
    """Return what the law knows of the valve: what it knew in the step before, where nothing has been learnt since."""
    statics, valve = seen.statics, seen.statics.valve
    drifts = valve is not None and valve.inverse.drift_per_s != 0.0
    known = (ratios, statics.balances, statics.held, valve)  # each is replaced whole when something is learnt
    if before is not None and not drifts:
        before_known = (before.ratios, before.landings, before.held, before.valve)
        if all(map(is_, known, before_known)):
            return before
    return Balance(
        ratios=ratios,
        landings=statics.balances,
        stroke_m=stroke_m,
        valve=valve,
        now_s=seen.sample.now_s if drifts else 0.0,
        held=statics.held,
        swing=statics.law.swing if valve is None else 0.0,
    )

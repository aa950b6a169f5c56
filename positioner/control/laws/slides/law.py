"""The law of slides behind the boundary of the laws: what it is shown, made into what it works with."""

from dataclasses import dataclass, replace

from config.codes import InhibitReason
from positioner.control.laws.boundary import Seen
from positioner.control.laws.slides import slide_law
from positioner.control.laws.slides.margins_over_travel import with_margins_at
from positioner.control.laws.slides.slide_balance import Balance
from positioner.control.laws.slides.slide_inverse import stem_observed
from positioner.control.laws.slides.slide_memory import SlideMemory, SlideSettings, StemObservation
from positioner.control.valve_knowledge import MIDDLE, ValveKnowledge
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.static_identification import StaticIdentification


@dataclass(frozen=True, slots=True)
class SlideLaw:
    """The law with what it remembers."""

    settings: SlideSettings
    memory: SlideMemory

    @property
    def command_pa(self) -> float:
        """The pressure that it asks for, Pa."""
        return self.memory.level_pa

    @property
    def inhibit_reason(self) -> InhibitReason:
        """Why it does not do what is asked for."""
        return self.memory.inhibit_reason

    def observe(self, seen: Seen) -> "SlideLaw":
        """Return the law after one sample."""
        memory, ratios = self.memory, seen.ratios
        if ratios is None:
            return replace(self, memory=slide_law.while_not_commanding(memory, seen.command_pa))
        balance = _balance(ratios, seen.statics, self.settings.stroke_m, seen.sample.now_s)
        memory = with_margins_at(memory, seen.reference_m, balance)
        memory = slide_law.step(memory, _observed(seen), seen.reference_m, balance, self.settings)
        return replace(self, memory=memory)

    def interrupted_pa(self, command_pa: float) -> float:
        """Return what to hold if something interrupts it after a command, Pa: of two slides the second."""
        return self.memory.held_pa(command_pa)

    def known(self, knowledge: ValveKnowledge, statics: StaticIdentification) -> ValveKnowledge:
        """Return what is known of the valve with the margins at the middle of the travel."""
        stroke_m = self.settings.stroke_m
        balance = _balance(knowledge.ratios, statics, stroke_m, 0.0)
        return replace(knowledge, margins=with_margins_at(self.memory, MIDDLE * stroke_m, balance).learnt)

    def restored(self, knowledge: ValveKnowledge) -> "SlideLaw":
        """Return the law with the margins of before a restart."""
        if knowledge.margins is None:
            return self
        at_m = MIDDLE * self.settings.stroke_m
        return replace(self, memory=replace(self.memory, margins=knowledge.margins, margins_at_m=at_m))


def _observed(seen: Seen) -> StemObservation:
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


def _balance(ratios: Ratios, statics: StaticIdentification, stroke_m: float, now_s: float) -> Balance:
    swing = statics.law.swing if statics.valve is None else 0.0
    return Balance(ratios, statics.balances, statics.held, stroke_m, statics.valve, now_s, swing)

"""One step of the controller: supervise, follow the reference, identify, choose the state, command.

`step` is a function of the memory, the sample and the requests; what it remembers is in the frozen `Memory` and in
the running integrals of the identification. It reads no clock.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

from config.codes import Fault, InhibitReason, Mode, State
from positioner.control.excitation import ActiveExcitation, climbed, excitation_after
from positioner.control.law_memory import LawInput, LawMemory, after_step, first_memory
from positioner.control.law_memory import held_pa as held_by_law_pa
from positioner.control.played_experiment import PlayedExperiment, Surroundings, experiment_after
from positioner.control.reference import Reference
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.control.staircase_excitation import Staircase
from positioner.control.states import Situation, law_inhibit_reason, state_in
from positioner.control.supervision import SupervisionMemory, supervise, usable
from positioner.estimation.acceptance import Applied, accept
from positioner.estimation.estimates import Estimates
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.estimation.landings.static_law import StaticLaw
from positioner.estimation.online import Identification
from positioner.estimation.refiner import Refiner


@dataclass(frozen=True, slots=True)
class ConsumedRequests:
    """Counts of the writes whose mode was left since: a reference or a manual pressure does not come back by itself."""

    reference_writes: int = 0
    manual_writes: int = 0


class ControllerMemory(NamedTuple):
    """What the controller remembers from one step to the next; a tuple, for it is made anew in each."""

    command_pa: float
    """The last command given."""
    held_pa: float
    """What S0 holds, and what it gets back after S3."""
    supervision: SupervisionMemory
    reference: Reference
    applied: Applied
    consumed: ConsumedRequests
    state: State
    excitation: ActiveExcitation | None
    experiment: PlayedExperiment
    identifying: bool
    law: LawMemory | None
    """None: a law without a memory."""


class Decision(NamedTuple):
    """What one step decided, for the wire, the registers and the recorder."""

    command_pa: float
    state: State
    mode: Mode
    fault: Fault
    inhibit_reason: InhibitReason
    reference_m: float
    delta_r_m: float
    sample_age_s: float
    estimates: Estimates
    applied: Applied
    static_law: StaticLaw
    experiment: PlayedExperiment


class Controller:
    """The control core with its memory. `held_pa` is the command the device has at the start: it is held."""

    def __init__(self, settings: Settings, held_pa: float, refiner: Refiner | None = None) -> None:
        self._settings = settings
        self._identification = Identification(settings.identification, refiner)
        self._statics = StaticIdentification(settings.limits.stroke_m)
        self._memory = ControllerMemory(
            command_pa=held_pa,
            held_pa=held_pa,
            supervision=SupervisionMemory(),
            reference=Reference(0.0),
            applied=settings.applied,
            consumed=ConsumedRequests(),
            state=State.S0_START,
            excitation=None,
            experiment=PlayedExperiment(),
            identifying=False,
            law=first_memory(settings.law_with_memory, held_pa),
        )

    @property
    def command_pa(self) -> float:
        """The last command given."""
        return self._memory.command_pa

    def step(self, sample: Sample, requests: Requests) -> Decision:
        """Decide on one sample."""
        self._memory, decision = step(
            self._memory, sample, requests, self._settings, self._identification, self._statics
        )
        return decision


def step(
    memory: ControllerMemory,
    sample: Sample,
    requests: Requests,
    settings: Settings,
    identification: Identification,
    statics: StaticIdentification,
) -> tuple[ControllerMemory, Decision]:
    """Return what is remembered and what is decided after one sample."""
    fresh = usable(sample, settings.limits)
    supervision = supervise(memory.supervision, sample, memory.command_pa, requests, settings.limits)
    consumed = _consumed(memory, supervision.mode, requests)
    reference = _reference(memory, supervision.mode, consumed, requests, sample.position_m if fresh else None)
    excitation, excitation_inhibit = excitation_after(
        memory.excitation,
        supervision.mode,
        sample,
        requests,
        settings,
        held_pa=memory.command_pa,
        reference=reference,
        ratios=memory.applied.ratios,
    )
    if excitation is not None and memory.excitation is None:
        statics.restart()
    experiment = experiment_after(
        memory.experiment,
        requests.experiment,
        Surroundings(
            now_s=sample.now_s,
            mode=supervision.mode,
            fault=supervision.fault,
            excited=requests.eta[0] == 0,
            position_m=sample.position_m if fresh else None,
            command_pa=memory.command_pa,
            held_pa=held_by_law_pa(memory.law, memory.command_pa),
        ),
        settings.experiment,
    )
    outcome = None
    if fresh:
        outcome = statics.update(sample.now_s, sample.position_m, memory.command_pa, sample.pressure_pa)
    if excitation is not None and fresh:
        excitation = climbed(excitation, outcome, statics, settings)
        excitation_inhibit = excitation.inhibit_reason
    identifying, applied = _identify(memory, excitation, sample, fresh, requests, identification, statics)
    if outcome is not None and outcome.landing and not experiment.commands:
        applied = statics.corrected(applied)
    situation = Situation(
        automatic=supervision.mode is Mode.AUTOMATIC,
        exciting=experiment.commands or (excitation is not None and not excitation.ended),
        law_ready=applied.ratios is not None,
        delta_r_m=reference.delta_m,
    )
    state = state_in(situation)
    held_pa = _held_pa(memory, state, supervision, sample)
    law_memory = None
    if memory.law is not None:
        seen = LawInput(
            sample=sample,
            usable=fresh,
            command_pa=memory.command_pa,
            reference_m=reference.value_m,
            ratios=applied.ratios if state in (State.S1_UP, State.S2_DOWN) else None,
            estimates=identification.estimates,
            outcome=outcome,
            statics=statics,
            stroke_m=settings.limits.stroke_m,
        )
        law_memory = after_step(memory.law, settings.law_with_memory, seen)

    if supervision.fault is not Fault.NONE:
        wanted_pa = settings.safe_pa(settings.limits.action_on(supervision.fault), held_pa)
    elif supervision.mode is Mode.MANUAL and requests.manual_writes != consumed.manual_writes:
        wanted_pa = requests.manual_pa
    else:
        exciting = experiment if experiment.commands else excitation
        wanted_pa = _pressure_pa(state, held_pa, exciting, sample.now_s, reference, applied, settings, law_memory)
    limited_pa = min(max(wanted_pa, settings.minimum_pa), settings.maximum_pa)
    command_pa = settings.delivered_pa(limited_pa)

    inhibit_reason = (
        excitation_inhibit if excitation_inhibit is not InhibitReason.NOTHING else law_inhibit_reason(situation)
    )
    if inhibit_reason is InhibitReason.NOTHING and limited_pa != wanted_pa:
        inhibit_reason = InhibitReason.LAW_BEYOND_LIMITS
    if inhibit_reason is InhibitReason.NOTHING and law_memory is not None:
        inhibit_reason = law_memory.inhibit_reason
    decision = Decision(
        command_pa=command_pa,
        state=state,
        mode=supervision.mode,
        fault=supervision.fault,
        inhibit_reason=inhibit_reason,
        reference_m=reference.value_m,
        delta_r_m=reference.delta_m,
        sample_age_s=sample.now_s - supervision.good_s,
        estimates=_estimates(excitation, identification, statics),
        applied=applied,
        static_law=statics.law,
        experiment=experiment,
    )
    return ControllerMemory(
        command_pa,
        held_pa,
        supervision,
        reference,
        applied,
        consumed,
        state,
        excitation,
        experiment,
        identifying,
        law_memory,
    ), decision


def _consumed(memory: ControllerMemory, mode: Mode, requests: Requests) -> ConsumedRequests:
    """Return which writes are consumed: those whose mode is left now."""
    before, consumed = memory.supervision.mode, memory.consumed
    if mode is before:
        return consumed
    return ConsumedRequests(
        requests.reference_writes if before is Mode.AUTOMATIC else consumed.reference_writes,
        requests.manual_writes if before is Mode.MANUAL else consumed.manual_writes,
    )


def _reference(
    memory: ControllerMemory,
    mode: Mode,
    consumed: ConsumedRequests,
    requests: Requests,
    stem_m: float | None,
) -> Reference:
    """Return the reference in force. Outside automatic it follows the stem: delta r counts from where the stem is."""
    written = requests.reference_writes != consumed.reference_writes
    start = memory.reference
    if mode is not Mode.AUTOMATIC or memory.supervision.mode is not mode:
        start = Reference(start.value_m if stem_m is None else stem_m)
    return start.follow(requests.reference_m) if mode is Mode.AUTOMATIC and written else start


def _identify(
    memory: ControllerMemory,
    excitation: ActiveExcitation | None,
    sample: Sample,
    fresh: bool,
    requests: Requests,
    identification: Identification,
    statics: StaticIdentification,
) -> tuple[bool, Applied]:
    """Run the estimators while eta_2 or eta_3 asks for it; what they find is applied when they are switched off."""
    parameters, friction = requests.eta[1] == 0, requests.eta[2] == 0
    wanted = (parameters or friction) and not (excitation is not None and excitation.ended)
    if not wanted:
        if not memory.identifying:
            return False, memory.applied
        if memory.excitation is not None and memory.excitation.by_slides:
            return False, statics.accepted(memory.applied)
        return False, accept(memory.applied, statics.tested(identification.estimates))
    if not memory.identifying or (excitation is not None and memory.excitation is None):
        identification.restart()
    moves_before = identification.moves
    if fresh:
        identification.update(
            sample.time_s,
            sample.position_m,
            sample.pressure_pa,
            parameters=parameters,
            friction=friction,
            passive=requests.eta[0] == 1,
        )
    # No excitation ends, so the estimates of ordinary moves are applied move by move.
    move_identified = identification.moves != moves_before
    return True, accept(memory.applied, statics.tested(identification.estimates)) if move_identified else memory.applied


def _estimates(
    excitation: ActiveExcitation | None, identification: Identification, statics: StaticIdentification
) -> Estimates:
    """Return the estimates as tested on the landings; the progress of a staircase is its own."""
    estimates = statics.tested(identification.estimates)
    if excitation is None or not isinstance(excitation.signal, Staircase):
        return estimates
    return replace(estimates, progress=excitation.signal.progress)


def _held_pa(memory: ControllerMemory, state: State, supervision: SupervisionMemory, sample: Sample) -> float:
    """Return what to hold: the last command, for a push what follows it; over S3 the one before it.

    After a fault what a device came back with.
    """
    if sample.held_pa is not None and supervision.fault is not Fault.NONE:
        return sample.held_pa
    if State.S3_IDENTIFY in (memory.state, state):
        return memory.held_pa
    return held_by_law_pa(memory.law, memory.command_pa)


def _pressure_pa(
    state: State,
    held_pa: float,
    exciting: ActiveExcitation | PlayedExperiment | None,
    now_s: float,
    reference: Reference,
    applied: Applied,
    settings: Settings,
    law_memory: LawMemory | None,
) -> float:
    """Return the pressure of a state, Pa."""
    if state is State.S3_IDENTIFY and exciting is not None:
        return exciting.pressure_pa(now_s)
    if state in (State.S1_UP, State.S2_DOWN) and applied.ratios is not None:
        if law_memory is not None:
            return law_memory.level_pa
        return settings.law(reference.value_m, 1 if state is State.S1_UP else -1, applied.ratios)
    return held_pa

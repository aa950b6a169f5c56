"""One step of the controller: supervise, follow the reference, identify, choose the state, command.

`step` is a function of the memory, the sample and the requests; what it remembers is in the frozen `Memory` and in
the running integrals of the identification. It reads no clock.
"""

from dataclasses import dataclass, replace

from config.codes import Fault, InhibitReason, Mode, State
from positioner.control import breakaway_law as breakaway
from positioner.control import conventional_law as conventional
from positioner.control import slide_law as slides
from positioner.control.balance_law import balance_pa
from positioner.control.breakaway_memory import BreakawayMemory, Observation, initial_memory
from positioner.control.conventional_law import ConventionalMemory
from positioner.control.excitation import ActiveExcitation, climbed, excitation_after
from positioner.control.reference import Reference
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.control.slide_memory import SlideMemory, StemObservation
from positioner.control.staircase_excitation import Staircase
from positioner.control.states import Situation, law_inhibit_reason, state_in
from positioner.control.supervision import SupervisionMemory, supervise, usable
from positioner.estimation.acceptance import Applied, accept
from positioner.estimation.estimates import Estimates
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.estimation.landings.static_law import StaticLaw
from positioner.estimation.online import Identification
from positioner.estimation.refiner import Refiner


@dataclass(frozen=True, slots=True)
class ConsumedRequests:
    """Counts of the writes whose mode was left since: a reference or a manual pressure does not come back by itself."""

    reference_writes: int = 0
    manual_writes: int = 0


@dataclass(frozen=True, slots=True)
class ControllerMemory:
    """What the controller remembers from one step to the next."""

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
    identifying: bool
    breakaway: BreakawayMemory | None
    """Of the law for small moves by pulses; None: another law."""
    slides: SlideMemory | None
    """Of the law of slides; None: another law."""
    conventional: ConventionalMemory | None
    """Of the conventional law; None: another law."""


@dataclass(frozen=True, slots=True)
class Decision:
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
            identifying=False,
            breakaway=initial_memory(settings.breakaway) if settings.breakaway else None,
            slides=SlideMemory(level_pa=held_pa) if settings.slides else None,
            conventional=ConventionalMemory(level_pa=held_pa) if settings.conventional else None,
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
    supervision = supervise(memory.supervision, sample, memory.command_pa, requests, settings.limits)
    consumed = _consumed(memory, supervision.mode, requests)
    reference = _reference(memory, supervision.mode, consumed, sample, requests, settings)
    excitation, excitation_inhibit = excitation_after(
        memory.excitation,
        supervision.mode,
        sample,
        requests,
        settings,
        held_pa=memory.command_pa,
        balanced_pa=_balanced_pa(memory, reference),
    )
    if excitation is not None and memory.excitation is None:
        statics.restart()
    outcome = _slide_outcome(memory, sample, settings, statics)
    if excitation is not None and usable(sample, settings.limits):
        excitation = climbed(excitation, outcome, statics, settings)
        excitation_inhibit = excitation.inhibit_reason
    identifying, applied = _identify(memory, excitation, sample, requests, settings, identification, statics)
    if outcome is not None and outcome.landing:
        applied = statics.corrected(applied)
    situation = Situation(
        automatic=supervision.mode is Mode.AUTOMATIC,
        exciting=excitation is not None and not excitation.ended,
        law_ready=applied.ratios is not None,
        delta_r_m=reference.delta_m,
    )
    state = state_in(situation)
    held_pa = _held_pa(memory, state, supervision, sample)
    breakaway_memory = _breakaway_memory(memory, state, reference, sample, settings, applied, identification.estimates)
    slide_memory = _slide_memory(memory, state, reference, sample, settings, applied, outcome, statics)
    conventional_memory = _conventional_memory(memory, state, reference, sample, settings, applied)
    law_memory = breakaway_memory or slide_memory or conventional_memory

    if supervision.fault is not Fault.NONE:
        wanted_pa = settings.safe_pa(settings.limits.action_on(supervision.fault), held_pa)
    elif supervision.mode is Mode.MANUAL and requests.manual_writes != consumed.manual_writes:
        wanted_pa = requests.manual_pa
    else:
        wanted_pa = _pressure_pa(state, held_pa, excitation, sample.now_s, reference, applied, settings, law_memory)
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
        identifying,
        breakaway_memory,
        slide_memory,
        conventional_memory,
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
    sample: Sample,
    requests: Requests,
    settings: Settings,
) -> Reference:
    """Return the reference in force. Outside automatic it follows the stem: delta r counts from where the stem is."""
    if mode is Mode.AUTOMATIC:
        written = requests.reference_writes != consumed.reference_writes
        start = memory.reference if memory.supervision.mode is mode else _reference_at_stem(memory, sample, settings)
        return start.follow(requests.reference_m) if written else start
    return _reference_at_stem(memory, sample, settings)


def _reference_at_stem(memory: ControllerMemory, sample: Sample, settings: Settings) -> Reference:
    return Reference(sample.position_m if usable(sample, settings.limits) else memory.reference.value_m)


def _balanced_pa(memory: ControllerMemory, reference: Reference) -> float:
    """Return the constant pressure that keeps the stem near its reference (seed, 4.1)."""
    ratios = memory.applied.ratios
    if ratios is None:
        return memory.command_pa
    return balance_pa(reference.value_m, -1 if reference.delta_m < 0 else 1, ratios)


def _identify(
    memory: ControllerMemory,
    excitation: ActiveExcitation | None,
    sample: Sample,
    requests: Requests,
    settings: Settings,
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
    if usable(sample, settings.limits):
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


def _slide_outcome(
    memory: ControllerMemory, sample: Sample, settings: Settings, statics: StaticIdentification
) -> SlideOutcome | None:
    """Return what the last change of the command did to the stem, in the step in which that is known."""
    if not usable(sample, settings.limits):
        return None
    return statics.update(sample.now_s, sample.position_m, memory.command_pa, sample.pressure_pa)


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
    return memory.command_pa if memory.breakaway is None else memory.breakaway.held_pa(memory.command_pa)


def _breakaway_memory(
    memory: ControllerMemory,
    state: State,
    reference: Reference,
    sample: Sample,
    settings: Settings,
    applied: Applied,
    estimates: Estimates,
) -> BreakawayMemory | None:
    """Return what the law for small moves remembers after this step, if it is the law."""
    if memory.breakaway is None or settings.breakaway is None:
        return None
    observation = Observation(sample.now_s, sample.position_m, sample.pressure_pa, usable(sample, settings.limits))
    if state in (State.S1_UP, State.S2_DOWN) and applied.ratios is not None:
        return breakaway.step(
            memory.breakaway, observation, reference.value_m, applied.ratios, estimates, settings.breakaway
        )
    return breakaway.while_not_commanding(memory.breakaway, observation, memory.command_pa)


def _slide_memory(
    memory: ControllerMemory,
    state: State,
    reference: Reference,
    sample: Sample,
    settings: Settings,
    applied: Applied,
    outcome: SlideOutcome | None,
    statics: StaticIdentification,
) -> SlideMemory | None:
    """Return what the law of slides remembers after this step, if it is the law."""
    if memory.slides is None or settings.slides is None:
        return None
    if state not in (State.S1_UP, State.S2_DOWN) or applied.ratios is None:
        return slides.while_not_commanding(memory.slides, memory.command_pa)
    observation = StemObservation(
        now_s=sample.now_s,
        position_m=sample.position_m,
        usable=usable(sample, settings.limits),
        rest=statics.detector.rest,
        quantum_m=statics.detector.quantum_m,
        outcome=outcome,
    )
    balance = slides.Balance(applied.ratios, statics.landings, statics.held, settings.limits.stroke_m)
    return slides.step(memory.slides, observation, reference.value_m, balance, settings.slides)


def _conventional_memory(
    memory: ControllerMemory,
    state: State,
    reference: Reference,
    sample: Sample,
    settings: Settings,
    applied: Applied,
) -> ConventionalMemory | None:
    """Return what the conventional law remembers after this step, if it is the law."""
    if memory.conventional is None or settings.conventional is None:
        return None
    if state not in (State.S1_UP, State.S2_DOWN) or applied.ratios is None:
        return conventional.while_not_commanding(memory.command_pa)
    if not usable(sample, settings.limits):
        return memory.conventional
    error_m = reference.value_m - sample.position_m
    return conventional.step(memory.conventional, sample.now_s, error_m, applied.ratios, settings.conventional)


def _pressure_pa(
    state: State,
    held_pa: float,
    excitation: ActiveExcitation | None,
    now_s: float,
    reference: Reference,
    applied: Applied,
    settings: Settings,
    law_memory: BreakawayMemory | SlideMemory | ConventionalMemory | None,
) -> float:
    """Return the pressure of a state, Pa."""
    if state is State.S3_IDENTIFY and excitation is not None:
        return excitation.pressure_pa(now_s)
    if state in (State.S1_UP, State.S2_DOWN) and applied.ratios is not None:
        if law_memory is not None:
            return law_memory.level_pa
        return settings.law(reference.value_m, 1 if state is State.S1_UP else -1, applied.ratios)
    return held_pa

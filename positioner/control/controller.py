"""One step of the controller: supervise, follow the reference, identify, choose the state, command.

`step` is a function of the memory, the sample and the requests; what it remembers is in the frozen `Memory` and in
the running integrals of the identification. It reads no clock.
"""

from dataclasses import replace

from config.codes import AUTOMATIC, MANUAL, S0, S1, S2, S3, InhibitReason, Mode, Refusal, Restored, State
from config.extended_valve import ExtendedValve, Inverse
from positioner.control import pressure_path
from positioner.control.controller_memory import ConsumedRequests, ControllerMemory, Decision
from positioner.control.excitation import NOTHING, ActiveExcitation, climbed, excitation_after
from positioner.control.identifying import estimates_tested, identify
from positioner.control.law_memory import LawInput, LawMemory, after_step, first_memory
from positioner.control.law_memory import held_pa as held_by_law_pa
from positioner.control.monitors import MonitorMemory, after_cycle
from positioner.control.played_experiment import PlayedExperiment, Surroundings, experiment_after
from positioner.control.pressure_path import PathMemory, long_held
from positioner.control.reference import Reference
from positioner.control.requests import Requests
from positioner.control.restoration import Restoration
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.control.states import Situation, law_inhibit_reason, state_in
from positioner.control.supervision import NO_FAULT, SupervisionMemory, supervise, usable
from positioner.control.valve_knowledge import ValveKnowledge, known, with_learnt
from positioner.estimation.acceptance import Applied
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.estimation.online import Identification
from positioner.estimation.refiner import Refiner

FOLLOWING = (S1, S2)
"""The states in which the law commands."""


class Controller:
    """The control core with its memory.

    Args:
        settings: of the valve.
        held_pa: the command the device has at the start: it is held.
        refiner: of identifications.
        restored: what was known of the valve before a restart.
    """

    def __init__(
        self,
        settings: Settings,
        held_pa: float,
        refiner: Refiner | None = None,
        restored: ValveKnowledge | None = None,
    ) -> None:
        self._settings = settings
        self._identification = Identification(settings.identification, refiner)
        self._statics = StaticIdentification(settings.limits.stroke_m, valve=settings.valve)
        if restored is not None:
            self._statics.restore(restored.landings, restored.held, restored.answers)
        self._memory = ControllerMemory(
            command_pa=held_pa,
            wanted_pa=held_pa,
            held_pa=held_pa,
            supervision=SupervisionMemory(),
            monitoring=MonitorMemory(),
            reference=Reference(0.0),
            applied=settings.applied if restored is None else Applied(restored.ratios),
            consumed=ConsumedRequests(),
            state=S0,
            excitation=None,
            experiment=PlayedExperiment(),
            identifying=False,
            law=with_learnt(first_memory(settings.law_with_memory, held_pa), restored),
            path=long_held(held_pa) if settings.valve is not None and settings.valve.inverse.delays else None,
            restoration=Restoration.of(restored, settings.valve),
        )

    @property
    def command_pa(self) -> float:
        """The last command given."""
        return self._memory.command_pa

    @property
    def left_pa(self) -> float:
        """What it holds from now on if it is left: no push, and no lead."""
        return held_by_law_pa(self._memory.law, self._memory.wanted_pa)

    @property
    def knowledge(self) -> ValveKnowledge | None:
        """What is to be kept over a restart; None while nothing was identified, or what was restored is not confirmed.

        May be asked by another thread: all it is made of is replaced whole.
        """
        memory = self._memory
        trust, exciting = memory.restoration.trust, memory.excitation is not None and not memory.excitation.ended
        followed = memory.applied.count > 0 or (self._settings.valve is not None and bool(self._statics.landings))
        found = trust is Restored.CONFIRMED or (followed and trust is not Restored.PROVISIONAL)
        # What is kept says where slides balance; of a stem that swings past that, it would not agree with a landing.
        if memory.applied.ratios is None or not found or exciting or self._statics.law.swing:
            return None
        settings, estimates = self._settings, self._identification.estimates
        stroke_m = settings.limits.stroke_m
        return known(memory.applied.ratios, estimates, self._statics, memory.law, stroke_m, settings.valve)

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
    acknowledged = requests.acknowledgements != memory.supervision.acknowledgements
    monitoring = after_cycle(
        MonitorMemory() if acknowledged else memory.monitoring,
        settings.monitoring,
        sample.now_s,
        sample.position_m if fresh else None,
        memory.command_pa,
        _sent_to_m(memory),
        faulty=memory.supervision.fault is not NO_FAULT,
    )
    supervision = supervise(
        memory.supervision,
        sample,
        memory.command_pa,
        requests,
        settings.limits,
        good=fresh,
        monitored=monitoring.fault_among(settings.monitoring) if monitoring.holding else NO_FAULT,
    )
    consumed = _consumed(memory, supervision, requests)
    waits = _waits(memory, supervision.mode, requests, settings, statics)
    reference = _reference(memory, supervision.mode, consumed, requests, sample.position_m if fresh else None, waits)
    excitation, excitation_inhibit = excitation_after(
        memory.excitation,
        supervision.mode,
        sample.now_s,
        sample.position_m if fresh else None,
        requests,
        settings,
        held_pa=memory.wanted_pa,
        reference=reference,
        ratios=memory.applied.ratios,
    )
    if excitation is not None and memory.excitation is None and not excitation.ended:
        statics.restart()
    experiment = _experiment(memory, supervision, sample.now_s, requests, settings)
    playing = experiment.commands
    outcome = _outcome(memory, sample, settings, statics) if fresh else None
    if excitation is not None and fresh:
        excitation = climbed(excitation, outcome, statics, settings)
        excitation_inhibit = excitation.inhibit_reason
    by_slides = settings.staircase is not None
    identifying, applied = identify(
        memory, excitation, sample, fresh, requests, identification, statics, by_slides=by_slides
    )
    ordinary = excitation is None and not playing
    restoration = _restoration(memory, applied, outcome if ordinary else None, settings)
    dropped = restoration.trust is Restored.DROPPED
    if dropped and memory.restoration.provisional:
        memory, applied = _nothing_known(memory, applied, settings, statics)
    elif outcome is not None and outcome.landing and not playing:
        applied = statics.corrected(applied)
    situation = Situation(
        supervision.mode is AUTOMATIC,
        playing or (excitation is not None and not excitation.ended),
        applied.ratios is not None and not (excitation is not None and excitation.unanswered),
        reference.delta_m,
        dropped,
    )
    state = state_in(situation)
    held_pa = _held_pa(memory, state, supervision, sample)
    law_memory = None
    if memory.law is not None:
        seen = LawInput(
            sample=sample,
            usable=fresh,
            command_pa=memory.wanted_pa,
            reference_m=reference.value_m,
            ratios=applied.ratios if state in FOLLOWING else None,
            estimates=identification.estimates,
            outcome=outcome,
            statics=statics,
            stroke_m=settings.limits.stroke_m,
            valve=settings.valve,
            provisional=restoration.provisional,
        )
        law_memory = after_step(memory.law, settings.law_with_memory, seen)

    if supervision.mode is MANUAL and requests.manual_writes != consumed.manual_writes:
        asked_pa = requests.manual_pa
    elif supervision.fault:
        asked_pa = settings.safe_pa(settings.limits.action_on(supervision.fault), held_pa)
    else:
        exciting = experiment if playing else excitation
        asked_pa = _pressure_pa(
            state, held_pa, exciting, sample.now_s, reference, applied, settings, law_memory, statics.valve
        )
    limited_pa = min(max(asked_pa, settings.minimum_pa), settings.maximum_pa)
    wanted_pa = settings.delivered_pa(limited_pa)
    path, command_pa = None, wanted_pa
    if memory.path is not None and settings.valve is not None:
        follows = not supervision.fault and state in FOLLOWING
        path = _path(memory.path, sample.now_s, wanted_pa, settings, settings.valve.inverse, lead=follows)
        command_pa = path.command_pa

    by_law = NOTHING if law_memory is None else law_memory.inhibit_reason
    inhibit_reason = (
        excitation_inhibit
        or (InhibitReason.RESTORED_WAITS if waits else law_inhibit_reason(situation))
        or (by_law if limited_pa == asked_pa else InhibitReason.LAW_BEYOND_LIMITS)
    )
    decision = Decision(
        command_pa,
        state,
        supervision.mode,
        supervision.fault,
        inhibit_reason,
        reference.value_m,
        reference.delta_m,
        sample.now_s - supervision.good_s,
        estimates_tested(excitation, identification, statics),
        applied,
        statics.law,
        restoration,
        experiment,
        monitoring.holding,
        supervision.position_m is not None,
    )
    return ControllerMemory(
        command_pa,
        wanted_pa,
        held_pa,
        supervision,
        monitoring,
        reference,
        applied,
        consumed,
        state,
        excitation,
        experiment,
        identifying,
        law_memory,
        path,
        restoration,
    ), decision


def _sent_to_m(memory: ControllerMemory) -> float | None:
    """Return where the law last sent the stem, m; None where it commands nothing."""
    reference = memory.reference
    if reference.delta_m == 0.0 or memory.state is S3 or memory.supervision.mode is not AUTOMATIC:
        return None
    return reference.value_m


def _experiment(
    memory: ControllerMemory,
    supervision: SupervisionMemory,
    now_s: float,
    requests: Requests,
    settings: Settings,
) -> PlayedExperiment:
    """Return the experiment after this sample; as it was where none is under way and none is asked for.

    It may begin on a sample that is repeated or lost: how old the last good one may be, supervision watches.
    """
    before = memory.experiment
    if before.is_idle(requests.experiment):
        return before
    around = Surroundings(
        now_s=now_s,
        mode=supervision.mode,
        fault=supervision.fault,
        excited=requests.eta[0] == 0,
        position_m=supervision.position_m,
        command_pa=memory.command_pa,
        held_pa=held_by_law_pa(memory.law, memory.wanted_pa),
    )
    return experiment_after(before, requests.experiment, around, settings.experiment)


def _outcome(
    memory: ControllerMemory, sample: Sample, settings: Settings, statics: StaticIdentification
) -> SlideOutcome | None:
    """Return what a change of the command did, in the step in which it is known.

    Of a device that was left alone, or is found with another command than it was given, nobody knows what it did
    meanwhile: that is no slide of a command. One that still holds what it was given after a lost reply has obeyed.
    """
    if sample.unattended_s > 0.0 or not _obeyed(memory, sample, settings):
        statics.detector.interrupt()
        return None
    path, valve = memory.path, settings.valve
    arrived = path is None or valve is None or path.has_arrived(sample.now_s, valve.inverse)
    return statics.update(sample.now_s, sample.position_m, memory.wanted_pa, sample.pressure_pa, arrived=arrived)


def _obeyed(memory: ControllerMemory, sample: Sample, settings: Settings) -> bool:
    """Whether the device holds the last command, where it was looked at anew."""
    held_pa = sample.held_pa
    return held_pa is None or abs(held_pa - memory.command_pa) <= settings.limits.restart_tolerance_pa


def _path(
    memory: PathMemory, now_s: float, wanted_pa: float, settings: Settings, inverse: Inverse, *, lead: bool
) -> PathMemory:
    """Return what is remembered of the pressure on its way, and with it the command."""
    limits_pa = (settings.minimum_pa, settings.maximum_pa)
    path = pressure_path.after_step(memory, now_s, wanted_pa, inverse, limits_pa, lead=lead)
    return path._replace(command_pa=settings.delivered_pa(path.command_pa))


def _nothing_known(
    memory: ControllerMemory, applied: Applied, settings: Settings, statics: StaticIdentification
) -> tuple[ControllerMemory, Applied]:
    """Forget what was restored, with all that a law has learnt by it: nothing is left to command by."""
    statics.restart()
    law = first_memory(settings.law_with_memory, memory.wanted_pa)
    return memory._replace(law=law), replace(applied, ratios=None, last_refusal=Refusal.CONTRADICTED_BY_LANDINGS)


def _waits(
    memory: ControllerMemory, mode: Mode, requests: Requests, settings: Settings, statics: StaticIdentification
) -> bool:
    """Whether a reference must wait for the landing of the move before it, which says whether what was restored holds.

    A law that commands all the while has no such moves.
    """
    if not memory.restoration.provisional or mode is not AUTOMATIC or not settings.moves_by_single_steps:
        return False
    asked = requests.reference_writes != memory.consumed.reference_writes
    return asked and requests.reference_m != memory.reference.value_m and statics.detector.rest is None


def _restoration(
    memory: ControllerMemory, applied: Applied, outcome: SlideOutcome | None, settings: Settings
) -> Restoration:
    """Return what has become of what was restored; an identification that is applied takes its place."""
    if applied.count != memory.applied.count:
        return memory.restoration.replaced()
    return memory.restoration.after(outcome, settings.limits.stroke_m)


def _consumed(memory: ControllerMemory, supervision: SupervisionMemory, requests: Requests) -> ConsumedRequests:
    """Return which writes are consumed: those whose mode is left now, or that a fault to be met by hand found."""
    before, mode, consumed = memory.supervision.mode, supervision.mode, memory.consumed
    latched = supervision.fault is not NO_FAULT and supervision.fault is not memory.supervision.fault
    by_hand = mode is MANUAL and latched
    if mode is before and not by_hand:
        return consumed
    return ConsumedRequests(
        requests.reference_writes if before is AUTOMATIC else consumed.reference_writes,
        requests.manual_writes if before is MANUAL or by_hand else consumed.manual_writes,
    )


def _reference(
    memory: ControllerMemory,
    mode: Mode,
    consumed: ConsumedRequests,
    requests: Requests,
    stem_m: float | None,
    waits: bool,
) -> Reference:
    """Return the reference in force. Outside automatic it follows the stem: delta r counts from where the stem is."""
    written = requests.reference_writes != consumed.reference_writes
    start = memory.reference
    if mode is not AUTOMATIC or memory.supervision.mode is not mode:
        start = Reference(start.value_m if stem_m is None else stem_m)
    follows = mode is AUTOMATIC and written and not waits
    return start.follow(requests.reference_m) if follows else start


def _held_pa(memory: ControllerMemory, state: State, supervision: SupervisionMemory, sample: Sample) -> float:
    """Return what to hold: the last command, for a push what follows it; over S3 the one before it.

    After a fault what a device came back with.
    """
    if sample.held_pa is not None and supervision.fault:
        return sample.held_pa
    if state is S3 or memory.state is S3:
        return memory.held_pa
    return held_by_law_pa(memory.law, memory.wanted_pa)


def _pressure_pa(
    state: State,
    held_pa: float,
    exciting: ActiveExcitation | PlayedExperiment | None,
    now_s: float,
    reference: Reference,
    applied: Applied,
    settings: Settings,
    law_memory: LawMemory | None,
    extended: ExtendedValve | None,
) -> float:
    """Return the pressure of a state, Pa."""
    if state is S3 and exciting is not None:
        return exciting.pressure_pa(now_s)
    if state in FOLLOWING and applied.ratios is not None:
        if law_memory is not None:
            return law_memory.level_pa
        s = 1 if state is S1 else -1
        if extended is not None:
            return extended.landing_pa(reference.value_m, s)
        return settings.law(reference.value_m, s, applied.ratios)
    return held_pa

"""One step of the controller: supervise, follow the reference, identify, choose the state, command.

    (memory', decision) = step(memory, sample, requests, settings)

`step` is a function of what it is given: it reads no clock and asks nobody. What a refinement has found is given to it,
too, and what is to be refined is left in the memory for `Controller`, which keeps the memory from step to step.

Most of the time a law waits. A decision stands as long as the DCS asks for nothing, monitors and supervision find
nothing, and the law that sees the sample asks for the same after it: then only that is worked out.
"""

from dataclasses import dataclass, replace
from math import isfinite
from operator import is_
from typing import NamedTuple

from config.codes import (
    AUTOMATIC,
    DROPPED,
    GOOD,
    MANUAL,
    S0,
    S1,
    S2,
    S3,
    Fault,
    InhibitReason,
    Mode,
    Refusal,
    Restored,
    State,
)
from config.quantities import DeviceStatus
from positioner.control import pressure_lead, unseen_direction
from positioner.control.controller_memory import (
    ConsumedRequests,
    ControllerMemory,
    Decision,
    consumed_of,
    decision_of,
    memory_of,
)
from positioner.control.excitation import NOTHING, ActiveExcitation, climbed, excitation_after
from positioner.control.identifying import identify, progress_of
from positioner.control.keyword_records import by_name
from positioner.control.laws.boundary import Law, Seen, seen_of
from positioner.control.monitors import MonitorMemory, Needs, after_cycle, needs_of
from positioner.control.played_experiment import PlayedExperiment, Surroundings, experiment_after
from positioner.control.pressure_clamp import clamped, number_of
from positioner.control.pressure_lead import PathMemory, long_held
from positioner.control.reference import Reference
from positioner.control.requests import Requests
from positioner.control.rest_band import RestBand, rest_band
from positioner.control.restored_knowledge import Restoration
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.control.staircase_excitation import Staircase
from positioner.control.states import law_inhibit_reason, state_in
from positioner.control.supervision import NO_FAULT, SupervisionMemory, supervise, usable
from positioner.control.travel.cutoffs import HIGH, WITHIN, sent_to_m
from positioner.control.travel.reference_ramp import OnCourse
from positioner.control.valve_knowledge import ValveKnowledge, known
from positioner.estimation.acceptance import Applied, Ratios
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.estimation.online import Identification
from positioner.estimation.refiner import Refinement, Refiner

NOTHING_FOUND = Refinement()
NOT_READY = int(DeviceStatus.NOT_READY)
"""A flag of the enumeration costs as much as half a law."""
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
        self._refiner = refiner
        self._memory = first_memory(settings, held_pa, restored)

    @property
    def command_pa(self) -> float:
        """The last command given."""
        return self._memory.last.command_pa

    @property
    def left_pa(self) -> float:
        """What it holds from now on if it is left: no push, and no lead."""
        left_pa = _left_pa(self._memory.law, self._memory)
        return left_pa if isfinite(left_pa) else self._memory.wanted_pa

    @property
    def knowledge(self) -> ValveKnowledge | None:
        """What is to be kept over a restart; None while nothing was identified, or what was restored is not confirmed.

        May be asked by another thread: all it is made of is replaced whole.
        """
        memory = self._memory
        last, statics, settings = memory.last, memory.statics, self._settings
        trust, exciting = last.restoration.trust, memory.excitation is not None and not memory.excitation.ended
        followed = last.applied.count > 0 or (settings.valve is not None and bool(statics.landings))
        found = trust is Restored.CONFIRMED or (followed and trust is not Restored.PROVISIONAL)
        # What is kept says where slides balance; of a stem that swings past that, it would not agree with a landing.
        if last.applied.ratios is None or not found or exciting or statics.law.swing:
            return None
        estimates, stroke_m = memory.identification.estimates, settings.limits.stroke_m
        seen = known(last.applied.ratios, estimates, statics, stroke_m, settings.valve)
        return memory.law.known(seen, statics)

    def begin(self) -> None:
        """Have the cycles begin: what was seen while the valve was set up is not judged by."""
        self._memory = self._memory._replace(supervision=self._memory.supervision.begun())

    def step(self, sample: Sample, requests: Requests) -> Decision:
        """Decide on one sample."""
        memory, refiner, refinement = self._memory, self._refiner, None
        if refiner is not None:
            refinement = Refinement.of(refiner) if memory.identifying else NOTHING_FOUND
        self._memory, decision = step(memory, sample, requests, self._settings, refinement)
        if refiner is not None and self._memory.identifying and (job := memory.identification.taken_job()) is not None:
            refiner.submit(job)
        return decision


def first_memory(settings: Settings, held_pa: float, restored: ValveKnowledge | None = None) -> ControllerMemory:
    """Return the memory before the first step, of a device that holds a command, Pa, and of what was known before."""
    statics = StaticIdentification(settings.limits.stroke_m, valve=settings.valve)
    identification = Identification(settings.identification)
    law = settings.law.begin(held_pa)
    if restored is not None:
        law = law.restored(restored)
        statics.restore(restored.landings, restored.held, restored.answers)
    nothing_yet = decision_of(
        command_pa=held_pa,
        state=S0,
        mode=Mode.HOLD,
        fault=NO_FAULT,
        inhibit_reason=InhibitReason.NOT_AUTOMATIC,
        reference_m=0.0,
        delta_r_m=0.0,
        estimates=identification.estimates,
        progress=identification.estimates.progress,
        applied=settings.applied if restored is None else Applied(restored.ratios),
        static_law=statics.law,
        restoration=Restoration.of(restored, settings.valve, settings.limits.stroke_m),
        dead_band_m=settings.dead_band.fixed_m or 0.0,
    )
    return memory_of(
        last=nothing_yet,
        wanted_pa=held_pa,
        held_pa=held_pa,
        law=law,
        path=long_held(held_pa) if settings.valve is not None and settings.valve.inverse.delays else None,
        course=OnCourse.begun(0.0, 0.0),
        identification=identification,
        statics=statics,
    )


@dataclass(slots=True)
class Now:
    """What one step is decided from: a class with slots, for it is made once and read some sixty times."""

    memory: ControllerMemory
    sample: Sample
    requests: Requests
    settings: Settings
    stem_m: float | None
    """Measured position of the stem, m; None without a good measurement."""
    watched: bool = False
    outcome: SlideOutcome | None = None
    """What the last change of the command did, once it is `watched`."""


def step(
    memory: ControllerMemory,
    sample: Sample,
    requests: Requests,
    settings: Settings,
    refinement: Refinement | None = None,
) -> tuple[ControllerMemory, Decision]:
    """Return what is remembered and what is decided after one sample.

    Args:
        memory: after the step before; its running integrals go on in the one that is returned (`copied`).
        sample: the latest.
        requests: of the DCS.
        settings: of the valve.
        refinement: of identifications, as it stands; None where nobody refines.
    """
    now = Now(memory, sample, requests, settings, sample.position_m if usable(sample, settings.limits) else None)
    monitoring, supervision = _supervised(now)
    if memory.stands_for is requests and (law := _law_where_all_stands(now, monitoring, supervision)) is not None:
        return memory._replace(monitoring=monitoring, supervision=supervision, law=law), memory.last
    after = _decide_anew(now, monitoring, supervision, refinement)
    if after.last is memory.last and _asks_alike(now, after.law) and _only_sees(after, requests, settings):
        after = after._replace(stands_for=requests)
    return after, after.last


def _decide_anew(
    now: Now, monitoring: MonitorMemory, supervision: SupervisionMemory, refinement: Refinement | None
) -> ControllerMemory:
    """Return what is remembered, and with it what is decided, made anew."""
    memory, sample, requests, settings = now.memory, now.sample, now.requests, now.settings
    mode = supervision.mode
    consumed = _consumed(now, supervision)
    waits = memory.last.restoration.provisional and _waits(now, mode)
    reference, course = _reference(now, mode, consumed, waits=waits)
    experiment = _experiment(now, supervision)
    playing = experiment.commands
    excitation, excitation_inhibit = _excited(now, supervision, reference)
    outcome = _outcome(now)
    if excitation is not None and not excitation.ended and now.stem_m is not None:
        excitation = climbed(excitation, outcome, memory.statics, settings)
        excitation_inhibit = excitation.inhibit_reason
    exciting = excitation is not None and not excitation.ended
    identifying, found = identify(
        memory,
        excitation,
        sample,
        requests,
        refinement,
        fresh=now.stem_m is not None,
        by_slides=settings.staircase is not None,
    )
    restoration = _restoration(now, found, None if exciting or playing else outcome, mode)
    is_dropped = restoration.trust is DROPPED
    dropped = is_dropped and memory.last.restoration.provisional
    applied, law_before = found, memory.law
    if dropped:
        applied, law_before = _nothing_known(now, found)
    elif outcome is not None and outcome.landing and not playing:
        applied = memory.statics.corrected(found)
    is_ready = applied.ratios is not None and not (excitation is not None and excitation.unanswered)
    state = state_in(
        automatic=mode is AUTOMATIC, exciting=playing or exciting, is_ready=is_ready, delta_r_m=reference.delta_m
    )
    held_pa = _held_pa(now, state, supervision, law_before)
    following = state in FOLLOWING
    cut_off = settings.cutoffs.after(memory.last.cut_off, reference.value_m) if following else WITHIN
    follows = following and cut_off == WITHIN
    dead_band_m = _dead_band_m(now, applied)
    seen = _seen(now, reference, applied.ratios if follows else None, outcome, dead_band_m)
    one_direction = _knows_one_direction(settings, applied.ratios)
    by_steps, law = _law(now, law_before, seen, one_direction=one_direction)

    asked_pa = _asked_pa(now, consumed, supervision, held_pa)
    if asked_pa is None:
        asked_pa = _pressure_pa(now, state, held_pa, experiment if playing else excitation, law, cut_off)
        if by_steps and applied.ratios is not None:
            asked_pa = _stepped_pa(now, by_steps, applied.ratios, reference)
    commanded = _commanded(now, asked_pa, lead=not supervision.fault and follows)
    if commanded is None:
        supervision, state, held_pa = supervision.failed(settings.limits), S0, memory.wanted_pa
        law = settings.law.begin(held_pa)
        consumed = _consumed(now, supervision)
        commanded = _held_instead(now)

    by_law = InhibitReason.ONE_DIRECTION if by_steps else law.inhibit_reason
    by_law = InhibitReason.CUT_OFF if cut_off != WITHIN else by_law
    inhibit_reason = (
        excitation_inhibit
        or (NOTHING if playing or excitation is None else excitation.waits_for(memory.statics))
        or (InhibitReason.RESTORED_WAITS if waits else NOTHING)
        or law_inhibit_reason(state, supervision.mode, is_ready=is_ready, is_dropped=is_dropped)
        or (by_law if settings.minimum_pa <= asked_pa <= settings.maximum_pa else InhibitReason.LAW_BEYOND_LIMITS)
    )
    decision = decision_of(
        command_pa=commanded.command_pa,
        state=state,
        mode=supervision.mode,
        fault=supervision.fault,
        inhibit_reason=inhibit_reason,
        reference_m=reference.value_m,
        delta_r_m=reference.delta_m,
        sample_age_s=0.0 if now.stem_m is not None else sample.now_s - supervision.good_s,
        estimates=memory.statics.tested(memory.identification.estimates),
        progress=progress_of(excitation, memory.identification.estimates),
        applied=applied,
        static_law=memory.statics.law,
        restoration=restoration,
        experiment=experiment,
        alarms=monitoring.holding,
        measured=supervision.position_m is not None,
        cut_off=cut_off,
        dead_band_m=dead_band_m,
        one_direction=one_direction,
    )
    if all(map(is_, decision, memory.last)):  # whoever follows decisions sees at once that nothing has changed
        decision = memory.last
    return memory_of(
        last=decision,
        wanted_pa=commanded.wanted_pa,
        held_pa=held_pa,
        supervision=supervision,
        monitoring=monitoring,
        reference=reference,
        consumed=consumed,
        excitation=excitation,
        identifying=identifying,
        law=law,
        path=commanded.path,
        course=course,
        first_landing=by_steps,
        identification=memory.identification,
        statics=memory.statics,
    )


def _only_sees(memory: ControllerMemory, requests: Requests, settings: Settings) -> bool:
    """Whether a law follows its reference, and nothing is under way that goes by time or by what it learns."""
    last = memory.last
    follows = last.state in FOLLOWING and last.cut_off == WITHIN and not memory.first_landing
    direct = settings.course is None and memory.path is None
    asked = 0 in requests.eta or last.experiment.commands or memory.excitation is not None
    return follows and direct and not (asked or last.restoration.provisional)


def _law_where_all_stands(now: Now, monitoring: MonitorMemory, supervision: SupervisionMemory) -> Law | None:
    """Return the law after a sample that shows nothing new, where it asks for what it did before; None: not so."""
    memory, sample, last = now.memory, now.sample, now.memory.last
    if supervision.mode is not last.mode or supervision.fault is not NO_FAULT or monitoring.holding is not last.alarms:
        return None
    if now.stem_m is None or _outcome(now) is not None:
        return None
    seen = _seen(now, memory.reference, last.applied.ratios, None, _dead_band_m(now, last.applied))
    by_steps, law = _law(now, memory.law, seen, one_direction=last.one_direction)
    if by_steps or seen.dead_band_m != last.dead_band_m or not _asks_alike(now, law):
        return None
    at_rest = memory.statics.detector.rest is not None
    memory.identification.look_on(sample.time_s, sample.position_m, sample.pressure_pa, at_rest=at_rest)
    return law


def _asks_alike(now: Now, law: Law) -> bool:
    """Whether a law asks for what the law of the step before did, be it interrupted or not, and for the same reason."""
    before, wanted_pa = now.memory.law, now.memory.wanted_pa
    if law is before:
        return True
    alike = law.command_pa == before.command_pa and law.inhibit_reason is before.inhibit_reason
    return alike and law.interrupted_pa(wanted_pa) == before.interrupted_pa(wanted_pa)


def _supervised(now: Now) -> tuple[MonitorMemory, SupervisionMemory]:
    """Return what the monitors and the supervision know after this sample."""
    memory, sample, settings = now.memory, now.sample, now.settings
    command_pa, before = memory.last.command_pa, memory.supervision
    acknowledged = now.requests.acknowledgements != before.acknowledgements
    monitoring = after_cycle(
        MonitorMemory() if acknowledged else memory.monitoring,
        settings.monitoring,
        now_s=sample.now_s,
        position_m=now.stem_m,
        command_pa=command_pa,
        pressure_pa=sample.pressure_pa,
        reference_m=_sent_to_m(now),
        faulty=before.fault is not NO_FAULT,
        needs=lambda band: _needs(now, band),
    )
    return monitoring, supervise(
        before,
        sample,
        command_pa,
        now.requests,
        settings.limits,
        good=now.stem_m is not None,
        monitored=monitoring.fault_among(settings.monitoring) if monitoring.holding else NO_FAULT,
    )


def _needs(now: Now, band: RestBand | None) -> Needs:
    """Return who commands, and what is known of what the stem needs; S3 and an experiment find that out.

    Args:
        now: what the step is decided from.
        band: the one before.
    """
    memory, excitation = now.memory, now.memory.excitation
    last, statics = memory.last, memory.statics
    signal = None if excitation is None or excitation.ended else excitation.signal
    tried = signal is not None or last.experiment.commands or last.restoration.provisional
    ratios = None if tried else last.applied.ratios
    allowed_pa = 0.0
    if isinstance(signal, Staircase) and now.settings.staircase is not None:
        allowed_pa = signal.most_pa(now.settings.staircase)
    return needs_of(
        by_law=last.state in FOLLOWING,
        band=rest_band(band, ratios, statics, now.settings.limits.stroke_m),
        allowed_pa=allowed_pa,
        answers_s=statics.detector.answers.longest_s,
    )


def _excited(
    now: Now, supervision: SupervisionMemory, reference: Reference
) -> tuple[ActiveExcitation | None, InhibitReason]:
    """Return the excitation of this sample, before its next step, and what inhibits it."""
    memory = now.memory
    excitation, inhibit_reason = excitation_after(
        memory.excitation,
        supervision.mode,
        now.sample.now_s,
        now.stem_m,
        now.requests,
        now.settings,
        held_pa=memory.wanted_pa,
        reference=reference,
        ratios=memory.last.applied.ratios,
        faulty=supervision.fault is not NO_FAULT,
    )
    if excitation is not None and memory.excitation is None and not excitation.ended:
        memory.statics.restart()
    return excitation, inhibit_reason


def _dead_band_m(now: Now, applied: Applied) -> float:
    """Return the error at rest that is left alone, m."""
    memory, settings = now.memory, now.settings.dead_band
    if settings.fixed_m is not None:
        return settings.fixed_m
    statics, breakaway = memory.statics, memory.identification.estimates.breakaway
    band = None
    if settings.jumps:
        band = rest_band(memory.monitoring.frozen.band, applied.ratios, statics, settings.stroke_m)
    jump_m, before_m = 0.0 if band is None else band.jump_m, memory.last.dead_band_m
    in_force_m = settings.in_force_m(statics.detector.noise_m, breakaway, applied.ratios, jump_m)
    return before_m if in_force_m == before_m else in_force_m


def _law(now: Now, before: Law, seen: Seen, *, one_direction: bool) -> tuple[int, Law]:
    """Return the law after this sample, and in which direction the stem goes by steps in its place, 0: it does not.

    So it goes where a law commands that knows friction of one direction.
    """
    memory, ratios = now.memory, seen.ratios
    if ratios is None or not one_direction:
        return 0, before.observe(seen)
    unseen = ratios.directions.unseen
    asked_back = unseen * (seen.reference_m - now.sample.position_m) <= 0.0
    asked_back = asked_back and seen.reference_m != memory.reference.value_m
    if memory.first_landing != unseen or asked_back:
        law = before.observe(seen)
        if not unseen_direction.needed(seen, ratios, number_of(law.command_pa), now.settings.limits.stroke_m):
            return 0, law
    return unseen, before.observe(seen._replace(ratios=None))


def _knows_one_direction(settings: Settings, ratios: Ratios | None) -> bool:
    """Whether a law that commands by what friction is would do so in a direction in which it is not known."""
    by_friction = settings.law.by_single_steps and settings.valve is None
    return by_friction and ratios is not None and ratios.directions.unseen != 0


def _stepped_pa(now: Now, direction: int, ratios: Ratios, reference: Reference) -> float:
    """Return the pressure of a stem on its way to its first landing in a direction, Pa: the next step once it rests."""
    rest, wanted_pa, stroke_m = now.memory.statics.detector.rest, now.memory.wanted_pa, now.settings.limits.stroke_m
    if rest is None or now.stem_m is None:
        return wanted_pa
    return unseen_direction.stepped_pa(wanted_pa, direction, ratios, reference.value_m - rest.position_m, stroke_m)


def _seen(
    now: Now, reference: Reference, ratios: Ratios | None, outcome: SlideOutcome | None, dead_band_m: float
) -> Seen:
    """Return what the law is shown; its ratios are None where it does not command."""
    return seen_of(
        sample=now.sample,
        usable=now.stem_m is not None,
        command_pa=now.memory.wanted_pa,
        reference_m=reference.value_m,
        dead_band_m=dead_band_m,
        direction=1 if reference.delta_m > 0.0 else -1 if reference.delta_m < 0.0 else 0,
        ratios=ratios,
        outcome=outcome,
        statics=now.memory.statics,
    )


def _asked_pa(now: Now, consumed: ConsumedRequests, supervision: SupervisionMemory, held_pa: float) -> float | None:
    """Return what an operator or a fault asks for, Pa; None where the state says it."""
    if supervision.mode is MANUAL and now.requests.manual_writes != consumed.manual_writes:
        return now.requests.manual_pa
    if supervision.fault:
        return now.settings.safe_pa(now.settings.limits.action_on(supervision.fault), held_pa)
    return None


def _sent_to_m(now: Now) -> float | None:
    """Return where the law last sent the stem, m; None where it commands nothing."""
    memory, reference = now.memory, now.memory.reference
    if reference.delta_m == 0.0 or memory.last.state is S3 or memory.supervision.mode is not AUTOMATIC:
        return None
    return reference.value_m if now.stem_m is None else sent_to_m(memory.last.cut_off, reference.value_m, now.stem_m)


def _experiment(now: Now, supervision: SupervisionMemory) -> PlayedExperiment:
    """Return the experiment after this sample; as it was where none is under way and none is asked for.

    It may begin on a sample that is repeated or lost: how old the last good one may be, supervision watches.
    """
    memory, requests = now.memory, now.requests
    before = memory.last.experiment
    if before.is_idle(requests.experiment):
        return before
    around = Surroundings(
        now_s=now.sample.now_s,
        mode=supervision.mode,
        fault=supervision.fault,
        excited=requests.eta[0] == 0,
        position_m=supervision.position_m,
        command_pa=memory.last.command_pa,
        held_pa=_left_pa(memory.law, memory),
    )
    return experiment_after(before, requests.experiment, around, now.settings.experiment)


def _outcome(now: Now) -> SlideOutcome | None:
    """Return what a change of the command did, in the step in which it is known: found out when first asked for.

    Of a device that was left alone, or is found with another command than it was given, nobody knows what it did
    meanwhile: that is no slide of a command. One that still holds what it was given after a lost reply has obeyed.
    """
    if now.watched or now.stem_m is None:
        return now.outcome
    now.watched, sample, wanted_pa = True, now.sample, now.memory.wanted_pa
    if sample.unattended_s > 0.0 or not _obeyed(now):
        now.memory.statics.detector.interrupt()
        return None
    path, valve = now.memory.path, now.settings.valve
    arrived = path is None or valve is None or path.has_arrived(sample.now_s, valve.inverse)
    now.outcome = now.memory.statics.update(sample.now_s, now.stem_m, wanted_pa, sample.pressure_pa, arrived=arrived)
    return now.outcome


def _obeyed(now: Now) -> bool:
    """Whether the device holds the last command, where it was looked at anew, and has done so all the while."""
    held_pa = now.sample.held_pa
    if now.sample.restarted:
        return False
    return held_pa is None or abs(held_pa - now.memory.last.command_pa) <= now.settings.limits.restart_tolerance_pa


class Commanded(NamedTuple):
    """What is commanded, Pa: the pressure wanted, the command that brings it about, and the pressure on its way."""

    wanted_pa: float
    command_pa: float
    path: PathMemory | None


commanded_of = by_name(Commanded)


def _commanded(now: Now, asked_pa: float, *, lead: bool) -> Commanded | None:
    """Return the command for a pressure that is asked for, Pa; None where it would not be a finite number."""
    settings, path = now.settings, now.memory.path
    limited_pa = clamped(asked_pa, settings.minimum_pa, settings.maximum_pa)
    if not isfinite(limited_pa):
        return None
    wanted_pa = command_pa = settings.delivered_pa(limited_pa)
    if path is not None and settings.valve is not None:
        limits_pa = (settings.minimum_pa, settings.maximum_pa)
        path = pressure_lead.after_step(path, now.sample.now_s, wanted_pa, settings.valve.inverse, limits_pa, lead=lead)
        if not isfinite(path.command_pa):
            return None
        command_pa = settings.delivered_pa(path.command_pa)
        path = path._replace(command_pa=command_pa)
    return commanded_of(wanted_pa=wanted_pa, command_pa=command_pa, path=path) if isfinite(command_pa) else None


def _held_instead(now: Now) -> Commanded:
    """Return the safe action in place of a command that is not finite; to hold is to hold the last one."""
    settings, memory = now.settings, now.memory
    action = settings.limits.action_on(Fault.COMMAND_NOT_FINITE)
    safe_pa = settings.delivered_pa(settings.safe_pa(action, memory.wanted_pa))
    path = None if memory.path is None else long_held(safe_pa, now.sample.now_s)
    return commanded_of(wanted_pa=safe_pa, command_pa=safe_pa, path=path)


def _nothing_known(now: Now, applied: Applied) -> tuple[Applied, Law]:
    """Forget what was restored, with all that a law has learnt by it: nothing is left to command by."""
    now.memory.statics.restart()
    law = now.settings.law.begin(now.memory.wanted_pa)
    return replace(applied, ratios=None, last_refusal=Refusal.CONTRADICTED_BY_LANDINGS), law


def _waits(now: Now, mode: Mode) -> bool:
    """Whether a reference must wait for the landing of the move before it, which says whether what was restored holds.

    A law that commands all the while has no such moves.
    """
    return _tries_restored(now, mode) and now.settings.law.by_single_steps and now.memory.statics.detector.rest is None


def _tries_restored(now: Now, mode: Mode) -> bool:
    """Whether a reference that is new would be followed by what was restored and is provisional."""
    memory, requests = now.memory, now.requests
    if not memory.last.restoration.provisional or mode is not AUTOMATIC:
        return False
    asked = requests.reference_writes != memory.consumed.reference_writes
    return asked and requests.reference_m != memory.reference.value_m


def _restoration(now: Now, applied: Applied, outcome: SlideOutcome | None, mode: Mode) -> Restoration:
    """Return what has become of what was restored; an identification that is applied takes its place."""
    memory, before = now.memory, now.memory.last.restoration
    if applied.count != memory.last.applied.count:
        return before.replaced()
    if not before.provisional:
        return before
    rest = memory.statics.detector.rest
    if outcome is None and rest is not None and now.stem_m is not None and _tries_restored(now, mode):
        return before.where_it_rests(rest.position_m, rest.std_m, memory.wanted_pa, now.sample.now_s)
    return before.after(outcome)


def _consumed(now: Now, supervision: SupervisionMemory) -> ConsumedRequests:
    """Return which writes are consumed: those whose mode is left now, or that a fault to be met by hand found."""
    memory, requests = now.memory, now.requests
    before, mode, consumed = memory.supervision.mode, supervision.mode, memory.consumed
    latched = supervision.fault is not NO_FAULT and supervision.fault is not memory.supervision.fault
    by_hand = mode is MANUAL and latched
    if mode is before and not by_hand:
        return consumed
    return consumed_of(
        reference_writes=requests.reference_writes if before is AUTOMATIC else consumed.reference_writes,
        manual_writes=requests.manual_writes if before is MANUAL or by_hand else consumed.manual_writes,
    )


def _reference(now: Now, mode: Mode, consumed: ConsumedRequests, *, waits: bool) -> tuple[Reference, OnCourse]:
    """Return the reference in force, and its course.

    Outside automatic, and until one is asked for, it follows the stem: delta r counts from where the stem is.

    So it does where what is asked for is in force already and the stem is elsewhere: S3 may have taken it there.
    """
    memory, requests, settings = now.memory, now.requests, now.settings.course
    written = requests.reference_writes != consumed.reference_writes
    start = memory.reference
    stands_m = start.value_m if now.stem_m is None else now.stem_m
    if mode is not AUTOMATIC or memory.supervision.mode is not mode or not written:
        start = Reference(stands_m)
    if mode is not AUTOMATIC or not written or waits:
        return start, memory.course if settings is None else OnCourse.begun(start.value_m, now.sample.now_s)
    asked_m, course = requests.reference_m, memory.course
    if settings is not None:
        course = settings.after(course, now.sample.now_s, start.value_m, asked_m)
        asked_m = course.reference_m
    reference = start.follow(asked_m)
    if reference.delta_m != 0.0 or memory.last.state is S3:
        return reference, course
    return Reference(stands_m).follow(asked_m), course


def _held_pa(now: Now, state: State, supervision: SupervisionMemory, law: Law) -> float:
    """Return what to hold: the last command, for a push what follows it; over S3 the one before it.

    After a fault, and at first, what a device is found with. After a fault also what one shows that does not obey: it
    may be operated locally, and shall stay where it is when it is given back.
    """
    memory, sample = now.memory, now.sample
    if sample.held_pa is not None and (supervision.fault or memory.supervision.awaited):
        return sample.held_pa
    if supervision.fault and sample.quality is GOOD and sample.status & NOT_READY:
        return sample.pressure_pa
    if state is S3 or memory.last.state is S3:
        return memory.held_pa
    return _left_pa(law, memory)


def _left_pa(law: Law, memory: ControllerMemory) -> float:
    """Return what a law has held if something interrupts it now, Pa; NaN where it says no number."""
    return number_of(law.interrupted_pa(memory.wanted_pa))


def _pressure_pa(
    now: Now,
    state: State,
    held_pa: float,
    exciting: ActiveExcitation | PlayedExperiment | None,
    law: Law,
    cut_off: int,
) -> float:
    """Return the pressure of a state, Pa."""
    if cut_off != WITHIN:
        return now.settings.maximum_pa if cut_off == HIGH else now.settings.minimum_pa
    if state is S3 and exciting is not None:
        return exciting.pressure_pa(now.sample.now_s)
    return number_of(law.command_pa) if state in FOLLOWING else held_pa

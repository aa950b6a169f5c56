"""The estimators in S3 and on ordinary moves: when they run, and when what they found is applied.

eta_2 and eta_3 switch them on; what they find is tested on the landings and applied when they are switched off.

A staircase identifies by its landings alone. What it found is judged in the cycle in which it ends, whatever ends it:

    the DCS, its time, what is no longer permitted    the static law, if it is valid
    a fault, another mode, a stem that is not seen    that of a complete staircase; else it was broken off

The other estimators have no say in that, nor later: without an excitation they learn from ordinary moves, move by move.
"""

from config.codes import InhibitReason, Refusal
from positioner.control.controller_memory import ControllerMemory
from positioner.control.excitation import ActiveExcitation
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.control.staircase_excitation import Staircase
from positioner.estimation.acceptance import Applied, accept
from positioner.estimation.estimates import Estimates
from positioner.estimation.refiner import Refinement


def identify(
    memory: ControllerMemory,
    excitation: ActiveExcitation | None,
    sample: Sample,
    requests: Requests,
    refinement: Refinement | None,
    *,
    fresh: bool,
    by_slides: bool,
) -> tuple[bool, Applied]:
    """Return whether the estimators run, and what is applied after this sample."""
    applied = memory.last.applied
    wanted = 0 in requests.eta[1:] and _moves_count(excitation, requests, by_slides=by_slides)
    if _staircase_is_over(memory, excitation, wanted=wanted):
        broken_off = excitation is not None and (excitation.broken_off or excitation.unanswered)
        if excitation is not None and excitation.inhibit_reason is InhibitReason.STAIRCASE_LIMITED:
            memory.statics.refuse_as_few()
        return False, _concluded(memory, broken_off=broken_off)
    if wanted:
        begins = not memory.identifying or (excitation is not None and memory.excitation is None)
        return True, _learnt(memory, sample, requests, refinement, begins=begins, fresh=fresh)
    if fresh:
        at_rest = memory.statics.detector.rest is not None
        memory.identification.look_on(sample.time_s, sample.position_m, sample.pressure_pa, at_rest=at_rest)
    if not memory.identifying or by_slides:
        return False, applied
    if excitation is not None and excitation.broken_off and memory.identification.estimates.progress < 1.0:
        return False, applied.refused(Refusal.BROKEN_OFF)
    return False, _tested(memory)


def _moves_count(excitation: ActiveExcitation | None, requests: Requests, *, by_slides: bool) -> bool:
    """Whether the stem moves by what the estimators may learn from: an excitation under way, or ordinary moves.

    Moves are no ordinary ones while eta_1 asks for a staircase: that has ended, or could not begin.
    """
    if excitation is not None:
        return not excitation.ended
    return not (by_slides and requests.eta[0] == 0)


def _staircase_is_over(memory: ControllerMemory, excitation: ActiveExcitation | None, *, wanted: bool) -> bool:
    """Whether a staircase from which was identified has ended with this sample, or eta_2 and eta_3 are switched off."""
    if not memory.identifying or memory.excitation is None or not memory.excitation.by_slides:
        return False
    return excitation is None or excitation.ended or not wanted


def _learnt(
    memory: ControllerMemory,
    sample: Sample,
    requests: Requests,
    refinement: Refinement | None,
    *,
    begins: bool,
    fresh: bool,
) -> Applied:
    """Let the estimators take a sample; return what is applied: ordinary moves have no end, and are so one by one."""
    identification = memory.identification
    if begins:
        identification.restart()
    moves_before = identification.moves
    if fresh:
        eta_1, eta_2, eta_3 = requests.eta
        identification.update(
            sample.time_s,
            sample.position_m,
            sample.pressure_pa,
            parameters=eta_2 == 0,
            friction=eta_3 == 0,
            passive=eta_1 == 1,
            refinement=refinement,
        )
    return _tested(memory) if identification.moves != moves_before else memory.last.applied


def _tested(memory: ControllerMemory) -> Applied:
    """Return what is applied after motions: of a direction in which the stem did not move, what its landings say."""
    statics = memory.statics
    return statics.completed(accept(memory.last.applied, statics.tested(memory.identification.estimates)))


def _concluded(memory: ControllerMemory, *, broken_off: bool) -> Applied:
    """Return what is applied after a staircase; one that was complete had all that it wanted before."""
    staircase = None if memory.excitation is None else memory.excitation.signal
    if broken_off and not (isinstance(staircase, Staircase) and staircase.complete):
        return memory.last.applied.refused(Refusal.BROKEN_OFF)
    return memory.statics.accepted(memory.last.applied)


def progress_of(excitation: ActiveExcitation | None, estimates: Estimates) -> float:
    """Return how far an identification has come, 0 to 1: of a staircase its own progress, else of the window."""
    if excitation is None or not isinstance(excitation.signal, Staircase):
        return estimates.progress
    return excitation.signal.progress

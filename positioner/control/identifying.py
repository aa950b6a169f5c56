"""The estimators in S3 and on ordinary moves: when they run, and when what they found is applied.

eta_2 and eta_3 switch them on; what they find is tested on the landings and applied when they are switched off.

A staircase identifies by its landings alone. What it found is judged in the cycle in which it ends, whatever ends it:

    the DCS, its time, what is no longer permitted    the static law, if it is valid
    a fault, another mode, a stem that is not seen    that of a complete staircase; else it was broken off

The other estimators have no say in that, nor later: without an excitation they learn from ordinary moves, move by move.
"""

from dataclasses import replace

from config.codes import Refusal
from positioner.control.controller_memory import ControllerMemory
from positioner.control.excitation import ActiveExcitation
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.control.staircase_excitation import Staircase
from positioner.estimation.acceptance import Applied, accept
from positioner.estimation.estimates import Estimates
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.estimation.online import Identification


def identify(
    memory: ControllerMemory,
    excitation: ActiveExcitation | None,
    sample: Sample,
    fresh: bool,
    requests: Requests,
    identification: Identification,
    statics: StaticIdentification,
    *,
    by_slides: bool,
) -> tuple[bool, Applied]:
    """Run the estimators while eta_2 or eta_3 asks for it; what they find is applied when they are switched off."""
    parameters, friction = requests.eta[1] == 0, requests.eta[2] == 0
    under_way = excitation is not None and not excitation.ended
    ordinary = excitation is None and not (by_slides and requests.eta[0] == 0)
    wanted = (parameters or friction) and (under_way or ordinary)
    staircase = None if memory.excitation is None else memory.excitation.signal
    if memory.identifying and isinstance(staircase, Staircase) and not (wanted and under_way):
        broken_off = excitation is not None and (excitation.broken_off or excitation.unanswered)
        return False, _concluded(memory.applied, staircase, statics, broken_off=broken_off)
    if not wanted:
        found = memory.identifying and not by_slides
        return False, _accepted(memory.applied, identification, statics) if found else memory.applied
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
    return True, _accepted(memory.applied, identification, statics) if move_identified else memory.applied


def _accepted(applied: Applied, identification: Identification, statics: StaticIdentification) -> Applied:
    """Return what is applied after motions: of a direction in which the stem did not move, what its landings say."""
    return statics.completed(accept(applied, statics.tested(identification.estimates)))


def _concluded(applied: Applied, staircase: Staircase, statics: StaticIdentification, *, broken_off: bool) -> Applied:
    """Return what is applied after a staircase; one that was complete had all that it wanted before."""
    if broken_off and not staircase.complete:
        return applied.refused(Refusal.BROKEN_OFF)
    return statics.accepted(applied)


def estimates_tested(
    excitation: ActiveExcitation | None, identification: Identification, statics: StaticIdentification
) -> Estimates:
    """Return the estimates as tested on the landings; the progress of a staircase is its own."""
    estimates = statics.tested(identification.estimates)
    if excitation is None or not isinstance(excitation.signal, Staircase):
        return estimates
    return replace(estimates, progress=excitation.signal.progress)

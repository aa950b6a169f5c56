"""The estimators in S3 and on ordinary moves: when they run, and when what they found is applied.

eta_2 and eta_3 switch them on; what they find is tested on the landings and applied when they are switched off.
"""

from dataclasses import replace

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


def estimates_tested(
    excitation: ActiveExcitation | None, identification: Identification, statics: StaticIdentification
) -> Estimates:
    """Return the estimates as tested on the landings; the progress of a staircase is its own."""
    estimates = statics.tested(identification.estimates)
    if excitation is None or not isinstance(excitation.signal, Staircase):
        return estimates
    return replace(estimates, progress=excitation.signal.progress)

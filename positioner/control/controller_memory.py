"""What the controller remembers from one step to the next, and what one step decides.

Both are tuples, for they are made anew in each step, by name (`records`).
"""

from copy import deepcopy
from typing import NamedTuple

from config.codes import Fault, InhibitReason, Mode, State
from positioner.control.excitation import ActiveExcitation
from positioner.control.keyword_records import by_name
from positioner.control.laws.boundary import Law
from positioner.control.monitors import MonitorMemory
from positioner.control.played_experiment import PlayedExperiment
from positioner.control.pressure_lead import PathMemory
from positioner.control.reference import Reference
from positioner.control.requests import Requests
from positioner.control.restored_knowledge import Restoration
from positioner.control.supervision import SupervisionMemory
from positioner.control.travel.cutoffs import WITHIN
from positioner.control.travel.reference_ramp import OnCourse
from positioner.estimation.acceptance import Applied
from positioner.estimation.estimates import Estimates
from positioner.estimation.landings.static_identification import StaticIdentification
from positioner.estimation.landings.static_law import StaticLaw
from positioner.estimation.online import Identification


class Decision(NamedTuple):
    """What one step decided, for the wire, the registers and the recorder."""

    command_pa: float
    state: State
    mode: Mode
    fault: Fault
    inhibit_reason: InhibitReason
    reference_m: float
    delta_r_m: float
    estimates: Estimates
    progress: float
    """Of an identification, 0 to 1."""
    applied: Applied
    static_law: StaticLaw
    restoration: Restoration
    dead_band_m: float
    """Error at rest that is left alone."""
    sample_age_s: float = 0.0
    experiment: PlayedExperiment = PlayedExperiment()
    alarms: tuple[Fault, ...] = ()
    """Monitors whose condition holds for their delay, be they alarms or faults."""
    measured: bool = False
    """Whether there was a good measurement since the start."""
    cut_off: int = WITHIN
    """The stop onto which the stem is pressed."""
    one_direction: bool = False
    """Whether the law needs friction of a direction in which it is not known."""


class ConsumedRequests(NamedTuple):
    """Counts of the writes whose mode was left since: a reference or a manual pressure does not come back by itself."""

    reference_writes: int = 0
    manual_writes: int = 0


class ControllerMemory(NamedTuple):
    """What the controller remembers from one step to the next.

    The running integrals of both estimators go on in place: a memory is given to one step. `copied` gives another.
    """

    last: Decision
    """What was decided last: the command given, the state, what is applied."""
    wanted_pa: float
    """The pressure that the last command shall bring about: another, where it leads against a lag."""
    held_pa: float
    """What S0 holds, and what it gets back after S3."""
    law: Law
    path: PathMemory | None
    """None: nothing is known of a pressure that arrives late."""
    course: OnCourse
    """Of the reference in force to the one asked for."""
    identification: Identification
    statics: StaticIdentification
    supervision: SupervisionMemory = SupervisionMemory()
    monitoring: MonitorMemory = MonitorMemory()
    reference: Reference = Reference(0.0)
    consumed: ConsumedRequests = ConsumedRequests()
    excitation: ActiveExcitation | None = None
    identifying: bool = False
    first_landing: int = 0
    """The direction in which the stem goes by steps to its first landing, 0: it does not; see `unseen_direction`."""
    stands_for: Requests | None = None
    """The requests for which the last decision stands until something else is seen; None: each step decides anew."""

    def copied(self) -> "ControllerMemory":
        """Return another one of all that is known: what is done with either leaves no trace in the other."""
        identification, statics = deepcopy((self.identification, self.statics))
        return self._replace(identification=identification, statics=statics)


decision_of = by_name(Decision)
consumed_of = by_name(ConsumedRequests)
memory_of = by_name(ControllerMemory)

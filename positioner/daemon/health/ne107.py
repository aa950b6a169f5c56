"""The status of a valve by NAMUR NE 107, with its causes: a pure function of the last cycle and of the counts.

    F  failure                the valve or its bus does not answer as it should (register `fault` says how)
    C  function check         the valve does not follow the DCS on purpose: hold, manual, excitation, not identified
    S  out of specification   it cannot do what is asked of it, or nobody asks
    M  maintenance required   it does, and somebody should see to it soon
    good

The worst class counts, and in it the cause that stands first in `Ne107Cause`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from config.codes import Fault, InhibitReason, Mode, Ne107Cause, Ne107Status, State
from positioner.control.controller_memory import Decision
from positioner.daemon.health.valve_health import Health

CLASS = {
    Ne107Cause.FAULT: Ne107Status.FAILURE,
    Ne107Cause.NOT_AUTOMATIC: Ne107Status.FUNCTION_CHECK,
    Ne107Cause.EXCITED: Ne107Status.FUNCTION_CHECK,
    Ne107Cause.NOT_IDENTIFIED: Ne107Status.FUNCTION_CHECK,
    Ne107Cause.DCS_SILENT: Ne107Status.OUT_OF_SPECIFICATION,
    Ne107Cause.BEYOND_LIMITS: Ne107Status.OUT_OF_SPECIFICATION,
    Ne107Cause.STUCK: Ne107Status.OUT_OF_SPECIFICATION,
    Ne107Cause.NOT_AT_REST: Ne107Status.OUT_OF_SPECIFICATION,
    Ne107Cause.PRESSURE_ELSEWHERE: Ne107Status.OUT_OF_SPECIFICATION,
    Ne107Cause.ONE_DIRECTION: Ne107Status.OUT_OF_SPECIFICATION,
    Ne107Cause.FRICTION_HIGH: Ne107Status.MAINTENANCE_REQUIRED,
    Ne107Cause.FRICTION_LOW: Ne107Status.MAINTENANCE_REQUIRED,
    Ne107Cause.STICTION: Ne107Status.MAINTENANCE_REQUIRED,
    Ne107Cause.TRAVEL: Ne107Status.MAINTENANCE_REQUIRED,
    Ne107Cause.REVERSALS: Ne107Status.MAINTENANCE_REQUIRED,
    Ne107Cause.HIGH_HIGH: Ne107Status.OUT_OF_SPECIFICATION,
    Ne107Cause.HIGH: Ne107Status.MAINTENANCE_REQUIRED,
    Ne107Cause.LOW: Ne107Status.MAINTENANCE_REQUIRED,
    Ne107Cause.LOW_LOW: Ne107Status.OUT_OF_SPECIFICATION,
    Ne107Cause.TEST_OVERDUE: Ne107Status.MAINTENANCE_REQUIRED,
    Ne107Cause.MODEL_CHANGED: Ne107Status.MAINTENANCE_REQUIRED,
}
"""The class of each cause, unless the daemon's file says another; of those below it alone does."""
FaultClasses = Mapping[Fault, Ne107Status]
"""As table `[supervision]` of the daemon's file has them."""
MONITORED = {
    Fault.TRAVEL_DEVIATION: Ne107Cause.TRAVEL_DEVIATION,
    Fault.FROZEN_SENSOR: Ne107Cause.FROZEN_SENSOR,
    Fault.POSITION_RATE: Ne107Cause.POSITION_RATE,
    Fault.SATURATED: Ne107Cause.SATURATED,
    Fault.OVERRUN: Ne107Cause.OVERRUN,
    Fault.COMMAND_RATE: Ne107Cause.COMMAND_RATE,
}
"""What the monitors find, as a cause."""
LEFT_AWAY = frozenset({InhibitReason.TRIM_ENDED, InhibitReason.EXCURSION_BEYOND_LIMIT, InhibitReason.CUT_OFF})
"""Why the law has given a move up, or presses the stem onto a stop and corrects nothing: out of specification where
that is farther away than `[health] dead_band`."""
MISSED = 0.06
"""Of the stroke: a stem that stands still farther from its reference is never good, whatever the law says of it. The
seed's law alone leaves 5.3 % of small moves, (F_s - F_c)/k_s of the seed's valve."""


@dataclass(frozen=True, slots=True)
class Ne107Condition:
    """A status and what it rests on, the first cause deciding."""

    causes: tuple[Ne107Cause, ...]
    status: Ne107Status = Ne107Status.GOOD
    """The NE 107 class."""

    @property
    def cause(self) -> Ne107Cause:
        """The cause that decides."""
        return self.causes[0] if self.causes else Ne107Cause.NONE

    @property
    def bits(self) -> int:
        """All causes: bit n - 1 is cause n."""
        return sum(1 << (cause - 1) for cause in self.causes)


def ne107_condition(decision: Decision, health: Health) -> Ne107Condition:
    """Return the condition of a valve."""
    silent = decision.fault is Fault.DCS_SILENT
    monitored = {MONITORED[fault] for fault in (*decision.alarms, decision.fault) if fault in MONITORED}
    given_up = decision.inhibit_reason in LEFT_AWAY and health.away_m > health.settings.dead_band_m
    if given_up or health.left_away_m > MISSED * health.settings.stroke_m:
        monitored.add(Ne107Cause.TRAVEL_DEVIATION)
    holds = {
        Ne107Cause.FAULT: decision.fault is not Fault.NONE and not silent and decision.fault not in MONITORED,
        Ne107Cause.NOT_AUTOMATIC: decision.mode is not Mode.AUTOMATIC and not silent,
        Ne107Cause.EXCITED: decision.state is State.S3_IDENTIFY,
        Ne107Cause.NOT_IDENTIFIED: decision.mode is Mode.AUTOMATIC and decision.applied.ratios is None,
        Ne107Cause.DCS_SILENT: silent,
        Ne107Cause.BEYOND_LIMITS: decision.inhibit_reason is InhibitReason.LAW_BEYOND_LIMITS,
        Ne107Cause.STUCK: decision.inhibit_reason is InhibitReason.STUCK,
        Ne107Cause.NOT_AT_REST: decision.inhibit_reason is InhibitReason.NOT_AT_REST,
        Ne107Cause.PRESSURE_ELSEWHERE: decision.inhibit_reason is InhibitReason.PRESSURE_ELSEWHERE,
        Ne107Cause.ONE_DIRECTION: decision.one_direction,
    }
    classes = classes_of(health, decision.fault)
    holding = {cause for cause, now in holds.items() if now} | set(_wear(health)) | monitored | health.conditions
    causes = sorted(holding, key=lambda cause: (-classes[cause], cause))
    return Ne107Condition(tuple(causes), classes[causes[0]] if causes else Ne107Status.GOOD)


def classes_of(health: Health, fault: Fault = Fault.NONE) -> Mapping[Ne107Cause, Ne107Status]:
    """Return the class of each cause; that of a fault is the one in force."""
    of_faults = health.settings.fault_classes
    return {
        **CLASS,
        **health.settings.cause_classes,
        Ne107Cause.FAULT: class_of(fault, of_faults),
        Ne107Cause.DCS_SILENT: class_of(Fault.DCS_SILENT, of_faults),
        **{cause: class_of(each, of_faults) for each, cause in MONITORED.items()},
    }


def class_of(fault: Fault, classes: FaultClasses) -> Ne107Status:
    """Return the class of a fault."""
    return classes.get(fault, Ne107Status.FAILURE)


def _wear(health: Health) -> Iterator[Ne107Cause]:
    """Yield which counts have come to their limits."""
    settings, record = health.settings, health.record
    if 0 < settings.travel_limit_m < record.travel_m:
        yield Ne107Cause.TRAVEL
    if 0 < settings.reversal_limit < record.reversals:
        yield Ne107Cause.REVERSALS

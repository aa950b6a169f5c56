"""The status of a valve by NAMUR NE 107, with its causes: a pure function of the last cycle and of the counts.

    F  failure                the valve or its bus does not answer as it should (register `fault` says how)
    C  function check         the valve does not follow the DCS on purpose: hold, manual, excitation, not identified
    S  out of specification   it cannot do what is asked of it, or nobody asks
    M  maintenance required   it does, and somebody should see to it soon
    good

The worst class counts, and in it the cause that stands first in `HealthCause`.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from config.registers import Fault, HealthCause, Mode, Namur, Why
from positioner.control.controller import Decision
from positioner.control.states import State
from positioner.daemon.health.health import Health

CLASS = {
    HealthCause.FAULT: Namur.FAILURE,
    HealthCause.NOT_AUTOMATIC: Namur.FUNCTION_CHECK,
    HealthCause.EXCITED: Namur.FUNCTION_CHECK,
    HealthCause.NOT_IDENTIFIED: Namur.FUNCTION_CHECK,
    HealthCause.DCS_SILENT: Namur.OUT_OF_SPECIFICATION,
    HealthCause.BEYOND_LIMITS: Namur.OUT_OF_SPECIFICATION,
    HealthCause.STUCK: Namur.OUT_OF_SPECIFICATION,
    HealthCause.FRICTION_HIGH: Namur.MAINTENANCE_REQUIRED,
    HealthCause.FRICTION_LOW: Namur.MAINTENANCE_REQUIRED,
    HealthCause.STICTION: Namur.MAINTENANCE_REQUIRED,
    HealthCause.TRAVEL: Namur.MAINTENANCE_REQUIRED,
    HealthCause.REVERSALS: Namur.MAINTENANCE_REQUIRED,
}
"""The class of each cause, worst first."""

FEWEST_MOVES = 5
"""Moves judged before the stiction index says anything."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A status and what it rests on, the first cause deciding."""

    causes: tuple[HealthCause, ...]

    @property
    def status(self) -> Namur:
        """The NE 107 class."""
        return CLASS[self.causes[0]] if self.causes else Namur.GOOD

    @property
    def cause(self) -> HealthCause:
        """The cause that decides."""
        return self.causes[0] if self.causes else HealthCause.NONE

    @property
    def bits(self) -> int:
        """All causes: bit n - 1 is cause n."""
        return sum(1 << (cause - 1) for cause in self.causes)


def condition(decision: Decision, health: Health) -> Condition:
    """Return the condition of a valve."""
    silent = decision.fault is Fault.DCS_SILENT
    holds = {
        HealthCause.FAULT: decision.fault is not Fault.NONE and not silent,
        HealthCause.NOT_AUTOMATIC: decision.mode is not Mode.AUTOMATIC and not silent,
        HealthCause.EXCITED: decision.state is State.S3_IDENTIFY,
        HealthCause.NOT_IDENTIFIED: decision.mode is Mode.AUTOMATIC and decision.applied.ratios is None,
        HealthCause.DCS_SILENT: silent,
        HealthCause.BEYOND_LIMITS: decision.why is Why.LAW_BEYOND_LIMITS,
        HealthCause.STUCK: decision.why is Why.STUCK,
    }
    worn = set(_wear(health))
    return Condition(tuple(cause for cause in CLASS if cause in worn or holds.get(cause, False)))


def _wear(health: Health) -> Iterator[HealthCause]:
    """Yield what calls for maintenance. No comparison holds of the NaN that stands for a ratio not known yet."""
    settings, record, ratio = health.settings, health.record, health.friction_ratio
    if 0 < settings.friction_high < ratio:
        yield HealthCause.FRICTION_HIGH
    if ratio < settings.friction_low:
        yield HealthCause.FRICTION_LOW
    if record.moves_judged >= FEWEST_MOVES and 0 < settings.stiction_limit < record.stiction_index:
        yield HealthCause.STICTION
    if 0 < settings.travel_limit_m < record.travel_m:
        yield HealthCause.TRAVEL
    if 0 < settings.reversal_limit < record.reversals:
        yield HealthCause.REVERSALS

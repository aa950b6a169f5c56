"""Table `[alarms]`: limits of the opening, tests that are due, a promise about false alarms, the class of each cause.

What else is an alarm has its limits where it is watched: `[health]` and `[supervision]`.
"""

from typing import Annotated

from pydantic import AfterValidator, Field

from config.codes import Ne107Cause
from config.loading import Fraction, NonNegative, Positive, Schema
from config.supervision_table import Ne107Letter

BY_SUPERVISION = frozenset(
    {
        Ne107Cause.NONE,
        Ne107Cause.FAULT,
        Ne107Cause.DCS_SILENT,
        Ne107Cause.TRAVEL_DEVIATION,
        Ne107Cause.FROZEN_SENSOR,
        Ne107Cause.POSITION_RATE,
        Ne107Cause.SATURATED,
        Ne107Cause.OVERRUN,
        Ne107Cause.COMMAND_RATE,
    }
)
"""Causes whose class table `[supervision]` says."""
CLASSED = {each.name.lower(): each for each in Ne107Cause if each not in BY_SUPERVISION}
"""The others, by their keys in `[alarms.ne107]`."""


def _check_known_causes(classes: dict[str, Ne107Letter]) -> dict[str, Ne107Letter]:
    for name in classes:
        if name not in CLASSED:
            raise ValueError(f"{name}: unknown cause; allowed here: {', '.join(CLASSED)}")
    return classes


class PositionLimit(Schema):
    """A limit of the opening; without a threshold it is not watched."""

    threshold: Fraction | None = None
    dead_band: Annotated[float, Field(ge=0, le=0.5)] = 0.01
    """How far back the opening must be before the alarm is over, as a share of the stroke."""
    delay_s: NonNegative = 5.0
    """For which it must hold."""


class AlarmsTable(Schema):
    """Table `[alarms]`."""

    high_high: PositionLimit = PositionLimit()
    high: PositionLimit = PositionLimit()
    low: PositionLimit = PositionLimit()
    low_low: PositionLimit = PositionLimit()
    false_alarm_years: Annotated[float, Field(ge=1, le=1e6)] = 100.0
    """At most one false alarm of friction and stiction together in so many years of a valve, on the average."""
    model_change: Annotated[float, Field(ge=0, le=10)] = 0.2
    """Share by which an identified spring may differ from the first one; 0: no limit."""
    test_interval_days: NonNegative = 0.0
    """A test on the valve is due so often; 0: never."""
    shelve_limit_s: Positive = 28_800.0
    """The longest for which an alarm may be shelved."""
    ne107: Annotated[dict[str, Ne107Letter], AfterValidator(_check_known_causes)] = Field(default_factory=dict)
    """The class of a cause, by its name in lower case."""

"""Tables `[safety]` and `[supervision]` of the daemon's file: what ends in the safe state, and what else is watched.

Each monitor has a threshold (0: it is not watched), a delay for which it must hold, what is done then, and its class by
NAMUR NE 107. `alarm` only says so; anything else is a fault, latched, with that action. What `[safety]` itself watches
has its thresholds and delays there, action and class here. None knows the law.
"""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from config.loading import Fraction, NonNegative, Schema, between

SafeActionName = Literal["hold", "vent", "fill", "safe"]
"""What is done on a fault: `safe` is the pressure `[safety] safe_pressure_pa`."""
FaultActionName = Literal[SafeActionName, "manual"]
"""Where the device still obeys, an operator may command by hand instead: the pressure is held until they write one."""
Ne107Letter = Literal["F", "C", "S", "M"]


class SafetyTable(Schema):
    """Table `[safety]`: what ends in the safe state, and what that is."""

    action: SafeActionName = "hold"
    """On a fault of the device or its bus, and when the daemon ends."""
    lost_after_cycles: Annotated[int, Field(ge=1)] = 3
    stale_after_s: Annotated[float, between(1e-6, 3600.0)] = 0.1
    """Without a new measurement, or later than its cycle was due: then the daemon stood still."""
    travel_margin: Fraction = 0.1
    """A position farther than this fraction of the stroke outside the stroke is implausible."""
    read_back_s: NonNegative = 1.0
    """How often the device is asked for the command it holds, that another master may have written; 0 is never."""
    heartbeat_timeout_s: NonNegative = 0.0
    """Silence of the DCS that is a fault; 0 is never."""
    heartbeat_action: FaultActionName = "hold"
    safe_pressure_pa: NonNegative | None = None
    """Of the action "safe"."""


class Monitor(Schema):
    """What every monitor has."""

    threshold: NonNegative = 0.0
    delay_s: NonNegative = 1.0
    action: Literal["alarm", FaultActionName] = "alarm"
    ne107: Ne107Letter = "S"


class TravelDeviation(Monitor):
    """The stem away from its reference, in automatic outside S3, by a share of the stroke."""

    delay_s: NonNegative = 10.0


def _times_what_it_needs(threshold: float) -> float:
    """Return a threshold in times of what the valve needs; once it was a share of the pressure span, below 1.

    Raises:
        ValueError: it is neither 0 nor at least 1.
    """
    if 0.0 < threshold < 1.0:
        raise ValueError(
            "threshold is in times of the pressure that the valve is known to need, not a share of the span: "
            f"allowed are 0 (not watched) and 1 upward, got {threshold:g}"
        )
    return threshold


class FrozenSensor(Monitor):
    """A position the same to the digit, inside the travel, under so many times the pressure that the valve needs."""

    threshold: Annotated[NonNegative, AfterValidator(_times_what_it_needs)] = 1.25
    delay_s: NonNegative = 0.2
    action: Literal["alarm", FaultActionName] = "hold"
    ne107: Ne107Letter = "F"


class PositionRate(Monitor):
    """A position that changes by more strokes a second than the valve can."""

    delay_s: NonNegative = 0.0
    action: Literal["alarm", FaultActionName] = "hold"
    ne107: Ne107Letter = "F"


class Saturation(Monitor):
    """A command as near to its limit as this share of the span, though the stem is inside its travel."""

    delay_s: NonNegative = 10.0


class Overrun(Monitor):
    """Cycles, or replies, that take so many periods; in real time."""

    threshold: Annotated[float, Field(ge=0)] = 3.0


class CommandRate(Monitor):
    """A command that changes by more shares of the span a second, whoever gives it, while no fault is latched."""

    delay_s: NonNegative = 0.0


class SampleAge(Schema):
    """No measurement, or the same (`[safety] lost_after_cycles`, `stale_after_s`): no reply, stale."""

    action: SafeActionName | None = None
    """That of `[safety]` where nobody says; not by hand, for the device does not answer."""
    ne107: Ne107Letter = "F"


class Plausibility(Schema):
    """Measurements that cannot be (`[safety] travel_margin`, `lost_after_cycles`): implausible."""

    action: FaultActionName | None = None
    """That of `[safety]` where nobody says."""
    ne107: Ne107Letter = "F"


class Heartbeat(Schema):
    """No heartbeat (`[safety] heartbeat_timeout_s`): DCS silent."""

    action: FaultActionName | None = None
    """`[safety] heartbeat_action` where nobody says."""
    ne107: Ne107Letter = "S"


class SupervisionTable(Schema):
    """What is watched."""

    sample_age: SampleAge = SampleAge()
    plausibility: Plausibility = Plausibility()
    heartbeat: Heartbeat = Heartbeat()
    travel_deviation: TravelDeviation = TravelDeviation()
    frozen_sensor: FrozenSensor = FrozenSensor()
    position_rate: PositionRate = PositionRate()
    saturation: Saturation = Saturation()
    overrun: Overrun = Overrun()
    command_rate: CommandRate = CommandRate()

"""Monitors of supervision: conditions of stem, command and cycle that must not hold for longer than a delay.

    travel deviation   |r - x| > threshold * stroke                    in automatic, outside S3
    frozen sensor      x the same, |u - u_0| > threshold * span        u_0 when x last changed; x inside the travel
    position rate      |x - x_before| / (t - t_before) > threshold * stroke
    saturation         u within threshold * span of a limit            x inside the travel
    overrun            t - t_before > threshold * period               in real time
    command rate       |u - u_before| / (t - t_before) > threshold * span   while no fault is latched

t on the clock of the cycle. Nothing here knows the law. An alarm ends with its condition; a fault is latched by
`supervision`.
"""

from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from config.codes import Fault
from config.daemon_file import DaemonFile
from config.supervision_table import FaultActionName

ENDS = 0.02
"""Share of the stroke from each end of the travel: there a stem may well stand, whatever the pressure."""


@dataclass(frozen=True, slots=True)
class MonitorLimits:
    """Of one monitor: what its condition means, for how long it must hold, and what is done; None: it is told."""

    fault: Fault
    delay_s: float
    action: FaultActionName | None


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """The monitors in the order of their faults, and the bounds of their conditions; infinite where one is off.

    Attributes:
        deviation_m, frozen_pa, rate_m_per_s, overrun_s, rate_pa_per_s: beyond which a condition holds.
        low_pa, high_pa: outside which the command is saturated.
        low_m, high_m: away from both ends of the travel a stem is between these.
    """

    monitors: tuple[MonitorLimits, ...]
    deviation_m: float
    frozen_pa: float
    rate_m_per_s: float
    overrun_s: float
    rate_pa_per_s: float
    low_pa: float
    high_pa: float
    low_m: float
    high_m: float

    @classmethod
    def of(cls, file: DaemonFile) -> "MonitorSettings":
        """Return what a daemon's file asks for; a threshold of 0 switches a monitor off."""
        table, stroke_m, pressure = file.supervision, file.valve.stroke_m, file.pressure
        span_pa = pressure.maximum_pa - pressure.minimum_pa
        period_s = file.cycle.period_s if file.cycle.pace == "real_time" else 0.0
        monitors = (
            (Fault.TRAVEL_DEVIATION, table.travel_deviation),
            (Fault.FROZEN_SENSOR, table.frozen_sensor),
            (Fault.POSITION_RATE, table.position_rate),
            (Fault.SATURATED, table.saturation),
            (Fault.OVERRUN, table.overrun),
            (Fault.COMMAND_RATE, table.command_rate),
        )
        near_pa = table.saturation.threshold * span_pa or -inf
        return cls(
            monitors=tuple(
                MonitorLimits(fault, each.delay_s, None if each.action == "alarm" else each.action)
                for fault, each in monitors
            ),
            deviation_m=table.travel_deviation.threshold * stroke_m or inf,
            frozen_pa=table.frozen_sensor.threshold * span_pa or inf,
            rate_m_per_s=table.position_rate.threshold * stroke_m or inf,
            overrun_s=table.overrun.threshold * period_s or inf,
            rate_pa_per_s=table.command_rate.threshold * span_pa or inf,
            low_pa=pressure.minimum_pa + near_pa,
            high_pa=pressure.maximum_pa - near_pa,
            low_m=ENDS * stroke_m,
            high_m=(1.0 - ENDS) * stroke_m,
        )


NEVER = (inf, inf, inf, inf, inf, inf)
"""No condition holds."""


class MonitorMemory(NamedTuple):
    """What they remember; a tuple, for it is made anew in each cycle."""

    since_s: tuple[float, ...] = NEVER
    """Since when each condition holds; infinite where it does not."""
    seen_s: float = inf
    good_s: float = inf
    position_m: float = inf
    """The last good one, and when; infinite before there was one."""
    unmoved_pa: float = inf
    """The command when it last changed."""
    command_pa: float | None = None
    """The last seen, while no fault was latched."""
    holding: tuple[Fault, ...] = ()
    """Those whose condition has held for their delay."""

    def fault_among(self, settings: MonitorSettings) -> Fault:
        """Return the first that is a fault, NONE where all are alarms."""
        acting = (each.fault for each in settings.monitors if each.action is not None and each.fault in self.holding)
        return next(acting, Fault.NONE)


def after_cycle(
    memory: MonitorMemory,
    settings: MonitorSettings,
    now_s: float,
    position_m: float | None,
    command_pa: float,
    reference_m: float | None,
    *,
    faulty: bool = False,
) -> MonitorMemory:
    """Return what is known after a cycle.

    Args:
        memory, settings: of the monitors.
        now_s: on the clock of the cycle.
        position_m: None in a cycle without a good measurement.
        command_pa: the last given.
        reference_m: where the stem is asked to be; None where nobody asks.
        faulty: whether a fault is latched: then a safe action commands.
    """
    elapsed_s = now_s - memory.seen_s
    overrun = elapsed_s > settings.overrun_s
    before_pa, seen_pa = memory.command_pa, None if faulty else command_pa
    change_pa = 0.0 if before_pa is None or faulty else abs(command_pa - before_pa)
    fast = change_pa > settings.rate_pa_per_s * elapsed_s > 0.0
    if position_m is None:
        since_s, holding = _held(memory, settings, now_s, (False, False, False, False, overrun, fast))
        return memory._replace(since_s=since_s, seen_s=now_s, command_pa=seen_pa, holding=holding)
    way_m, passed_s = abs(position_m - memory.position_m), now_s - memory.good_s
    unmoved_pa = memory.unmoved_pa if way_m == 0.0 else command_pa
    inside = settings.low_m < position_m < settings.high_m
    conditions = (
        reference_m is not None and abs(reference_m - position_m) > settings.deviation_m,
        inside and abs(command_pa - unmoved_pa) > settings.frozen_pa,
        way_m > settings.rate_m_per_s * passed_s > 0.0,
        inside and not settings.low_pa <= command_pa <= settings.high_pa,
        overrun,
        fast,
    )
    since_s, holding = _held(memory, settings, now_s, conditions)
    return MonitorMemory(since_s, now_s, now_s, position_m, unmoved_pa, seen_pa, holding)


def _held(
    memory: MonitorMemory, settings: MonitorSettings, now_s: float, conditions: tuple[bool, ...]
) -> tuple[tuple[float, ...], tuple[Fault, ...]]:
    """Return since when conditions hold, and those that have held for their delay."""
    if True not in conditions:
        return NEVER, ()
    pairs = zip(conditions, memory.since_s, strict=True)
    since_s = tuple(min(since_s, now_s) if holds else inf for holds, since_s in pairs)
    long = (each.fault for each, since in zip(settings.monitors, since_s, strict=True) if now_s - since >= each.delay_s)
    return since_s, tuple(long)

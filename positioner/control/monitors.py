"""Monitors of supervision: conditions of stem, command and cycle that must not hold for longer than a delay.

    travel deviation   |r - x| > threshold * stroke                    in automatic, outside S3
    frozen sensor      x the same, |u - u_0| > threshold * span        u_0 when x last changed; x inside the travel
    position rate      |x - x_before| / (t - t_before) > threshold * stroke
    saturation         u within threshold * span of a limit            x inside the travel
    overrun            t - t_before > threshold * period               in real time

t on the clock of the cycle. Nothing here knows the law. An alarm ends with its condition; a fault is latched by
`supervision`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, isfinite
from typing import NamedTuple

from config.codes import Fault
from config.daemon_file import DaemonFile
from config.supervision_table import SafeActionName

ENDS = 0.02
"""Share of the stroke from each end of the travel: there a stem may well stand, whatever the pressure."""


@dataclass(frozen=True, slots=True)
class MonitorLimits:
    """Of one monitor: in SI units what its threshold means, the delay, and what is done; None: it is told."""

    fault: Fault
    threshold: float
    delay_s: float
    action: SafeActionName | None


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """The monitors that watch, in the order of their faults, and what they hold the valve against."""

    monitors: tuple[MonitorLimits, ...] = ()
    stroke_m: float = 1.0
    minimum_pa: float = 0.0
    maximum_pa: float = 0.0

    @classmethod
    def of(cls, file: DaemonFile) -> "MonitorSettings":
        """Return the monitors that a daemon's file switches on."""
        table, stroke_m = file.supervision, file.valve.stroke_m
        span_pa = file.pressure.maximum_pa - file.pressure.minimum_pa
        period_s = file.cycle.period_s if file.cycle.pace == "real_time" else 0.0
        units = (
            (Fault.TRAVEL_DEVIATION, table.travel_deviation, stroke_m),
            (Fault.FROZEN_SENSOR, table.frozen_sensor, span_pa),
            (Fault.POSITION_RATE, table.position_rate, stroke_m),
            (Fault.SATURATED, table.saturation, span_pa),
            (Fault.OVERRUN, table.overrun, period_s),
        )
        monitors = (
            MonitorLimits(fault, each.threshold * unit, each.delay_s, None if each.action == "alarm" else each.action)
            for fault, each, unit in units
        )
        watching = tuple(each for each in monitors if each.threshold > 0)
        return cls(watching, stroke_m, file.pressure.minimum_pa, file.pressure.maximum_pa)

    def inside(self, position_m: float) -> bool:
        """Return whether a stem is away from both ends of its travel."""
        return ENDS * self.stroke_m < position_m < (1.0 - ENDS) * self.stroke_m


class Watched(NamedTuple):
    """What the monitors look at in a cycle; of a cycle without a good measurement there is no position."""

    now_s: float
    position_m: float | None
    command_pa: float
    """The last given."""
    reference_m: float | None
    """Where the stem is asked to be; None where nobody asks."""


class MonitorMemory(NamedTuple):
    """What they remember; a tuple, for it is made anew in each cycle."""

    since_s: tuple[float, ...] = ()
    """Since when each condition holds; infinite where it does not."""
    seen_s: float = -inf
    good_s: float = -inf
    position_m: float = inf
    """The last good one, and when."""
    unmoved_pa: float = inf
    """The command when it last changed."""
    holding: tuple[Fault, ...] = ()
    """Those whose condition has held for their delay."""

    def fault_among(self, settings: MonitorSettings) -> Fault:
        """Return the first that is a fault, NONE where all are alarms."""
        acting = (each.fault for each in settings.monitors if each.action is not None and each.fault in self.holding)
        return next(acting, Fault.NONE)


def after_cycle(memory: MonitorMemory, watched: Watched, settings: MonitorSettings) -> MonitorMemory:
    """Return what is known after a cycle."""
    if not settings.monitors:
        return memory
    moved = watched.position_m is not None and watched.position_m != memory.position_m
    unmoved_pa = watched.command_pa if moved else memory.unmoved_pa
    before_s = memory.since_s or (inf,) * len(settings.monitors)
    since_s = tuple(
        (min(since_s, watched.now_s) if _holds(each, memory, watched, unmoved_pa, settings) else inf)
        for each, since_s in zip(settings.monitors, before_s, strict=True)
    )
    return MonitorMemory(
        since_s=since_s,
        seen_s=watched.now_s,
        good_s=memory.good_s if watched.position_m is None else watched.now_s,
        position_m=memory.position_m if watched.position_m is None else watched.position_m,
        unmoved_pa=unmoved_pa,
        holding=_held_long(since_s, watched.now_s, settings.monitors),
    )


def _held_long(since_s: Sequence[float], now_s: float, monitors: Sequence[MonitorLimits]) -> tuple[Fault, ...]:
    if all(each == inf for each in since_s):
        return ()
    held = zip(monitors, since_s, strict=True)
    return tuple(each.fault for each, since in held if since < inf and now_s - since >= each.delay_s)


def _holds(
    each: MonitorLimits, memory: MonitorMemory, watched: Watched, unmoved_pa: float, settings: MonitorSettings
) -> bool:
    """Return whether a condition holds now."""
    position_m, threshold = watched.position_m, each.threshold
    if each.fault is Fault.OVERRUN:
        return isfinite(memory.seen_s) and watched.now_s - memory.seen_s > threshold
    if position_m is None:
        return False
    match each.fault:
        case Fault.TRAVEL_DEVIATION:
            return watched.reference_m is not None and abs(watched.reference_m - position_m) > threshold
        case Fault.FROZEN_SENSOR:
            return settings.inside(position_m) and threshold < abs(watched.command_pa - unmoved_pa) < inf
        case Fault.POSITION_RATE:
            passed_s = watched.now_s - memory.good_s
            return 0.0 < passed_s < inf and abs(position_m - memory.position_m) > threshold * passed_s
        case _:
            room_pa = min(watched.command_pa - settings.minimum_pa, settings.maximum_pa - watched.command_pa)
            return settings.inside(position_m) and room_pa < threshold

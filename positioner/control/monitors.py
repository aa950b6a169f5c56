"""Monitors of supervision: conditions of stem, command and cycle that must not hold for longer than a delay.

    travel deviation   |r - x| > threshold * stroke                    in automatic, outside S3
    frozen sensor      x the same to the digit, u where no stem rests  by what the valve needs; x inside the travel
    position rate      |x - x_before| / (t - t_before) > threshold * stroke
    saturation         u within threshold * span of a limit            x inside the travel
    overrun            t - t_before > threshold * period               in real time
    command rate       |u - u_before| / (t - t_before) > threshold * span   while no fault is latched

t on the clock of the cycle. Nothing here knows the law. An alarm ends with its condition; a fault is latched by
`supervision`, which judges a silent DCS and stale samples itself.

Where no stem rests is where a valve that has been identified needs no more (`rest_band`): in automatic

    u, and the measured pressure, outside [p_low(x), p_high(x)]

otherwise, for by hand the stem may be anywhere in its band, |u - u_0| > p_high - p_low, u_0 when x last changed; and
where nothing is known, half of what the pressure limits allow. The time for which that holds adds up as long as x is
the same, for a law pushes one way and the other: to the delay, and to five times as long as the stem takes to answer
and the samples that tell a law that a push was in vain. For what the valve needs is known of the valve as identified:
one whose spring was changed since rests elsewhere, and comes by the next push, which is greater.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

from config.codes import Fault
from config.daemon_file import DaemonFile
from config.supervision_table import FaultActionName
from positioner.control.keyword_records import by_name
from positioner.control.rest_band import RestBand

ENDS = 0.02
"""Share of the stroke from each end of the travel: there a stem may well stand, whatever the pressure."""
NOTHING_KNOWN = 0.5
"""Of what the pressure limits allow: so much may a stem need of which nothing is known."""
ACTUATOR = 0.5
"""Of the pressures under which the stem rests: one measured so near the command in force is that of the actuator."""
ANSWERS, UNKNOWN_S = 5.0, 1.0
"""Times as long as the stem takes to answer; where that is not known yet, s."""
IN_VAIN = 8
"""Samples that tell a rest (`stem_at_rest`), and with it that a push was in vain."""


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
        deviation_m, rate_m_per_s, overrun_s, rate_pa_per_s: beyond which a condition holds.
        frozen_at: times of what the valve needs; infinite: it is not watched.
        frozen_s: for how long in all.
        span_pa: that the pressure limits allow.
        low_pa, high_pa: outside which the command is saturated.
        low_m, high_m: away from both ends of the travel a stem is between these.
    """

    monitors: tuple[MonitorLimits, ...]
    deviation_m: float
    frozen_at: float
    frozen_s: float
    span_pa: float
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
                MonitorLimits(
                    fault,
                    0.0 if fault is Fault.FROZEN_SENSOR else each.delay_s,
                    None if each.action == "alarm" else each.action,
                )
                for fault, each in monitors
            ),
            deviation_m=table.travel_deviation.threshold * stroke_m or inf,
            frozen_at=table.frozen_sensor.threshold or inf,
            frozen_s=table.frozen_sensor.delay_s,
            span_pa=span_pa,
            rate_m_per_s=table.position_rate.threshold * stroke_m or inf,
            overrun_s=table.overrun.threshold * period_s or inf,
            rate_pa_per_s=table.command_rate.threshold * span_pa or inf,
            low_pa=pressure.minimum_pa + near_pa,
            high_pa=pressure.maximum_pa - near_pa,
            low_m=ENDS * stroke_m,
            high_m=(1.0 - ENDS) * stroke_m,
        )


class Needs(NamedTuple):
    """Who commands, and what is known of what the stem needs.

    Attributes:
        by_law: whether the law commands.
        band: where the stem rests by what is known; None: that is not known, or is being found out.
        allowed_pa: what an excitation that finds it out allows itself.
        answers_s: how long the stem takes to answer a command; 0: that is not known.
    """

    by_law: bool
    band: RestBand | None
    allowed_pa: float
    answers_s: float


needs_of = by_name(Needs)

NEVER = (inf, inf, inf, inf, inf, inf)
"""No condition holds."""


class Frozen(NamedTuple):
    """What is known of a position that does not change, from its last change on."""

    command_pa: float = inf
    """The command then, ..."""
    pressure_pa: float = inf
    """... the measured pressure then ..."""
    unanswered_s: float = 0.0
    """... for how long since then no stem rests, ..."""
    longest_s: float = 0.0
    """... and for how long none need answer."""
    band: RestBand | None = None
    """What the valve was last known to need."""


frozen_of = by_name(Frozen)


class MonitorMemory(NamedTuple):
    """What they remember; a tuple, for it is made anew in each cycle."""

    since_s: tuple[float, ...] = NEVER
    """Since when each condition holds; infinite where it does not."""
    seen_s: float = inf
    good_s: float = inf
    position_m: float = inf
    """The last good one, and when; infinite before there was one."""
    frozen: Frozen = Frozen()
    """Of that one, since it last changed."""
    command_pa: float | None = None
    """The last seen, while no fault was latched."""
    holding: tuple[Fault, ...] = ()
    """Those whose condition has held for their delay."""

    def fault_among(self, settings: MonitorSettings) -> Fault:
        """Return the first that is a fault, NONE where all are alarms."""
        acting = (each.fault for each in settings.monitors if each.action is not None and each.fault in self.holding)
        return next(acting, Fault.NONE)


monitoring_of = by_name(MonitorMemory)


def after_cycle(
    memory: MonitorMemory,
    settings: MonitorSettings,
    *,
    now_s: float,
    position_m: float | None,
    command_pa: float,
    pressure_pa: float,
    reference_m: float | None,
    faulty: bool,
    needs: Callable[[RestBand | None], Needs],
) -> MonitorMemory:
    """Return what is known after a cycle.

    Args:
        memory, settings: of the monitors.
        now_s: on the clock of the cycle.
        position_m: None in a cycle without a good measurement.
        command_pa: the last given.
        pressure_pa: as measured.
        reference_m: where the stem is asked to be; None where nobody asks.
        faulty: whether a fault is latched: then a safe action commands.
        needs: what the stem needs, and the band before; asked only of one that stands still under another command.
    """
    elapsed_s = now_s - memory.seen_s
    overrun = elapsed_s > settings.overrun_s
    before_pa, seen_pa = memory.command_pa, None if faulty else command_pa
    fast = (
        seen_pa != before_pa
        and before_pa is not None
        and seen_pa is not None
        and abs(seen_pa - before_pa) > settings.rate_pa_per_s * elapsed_s > 0.0
    )
    if position_m is None:
        since_s, holding = _held(memory, settings, now_s, (False, False, False, False, overrun, fast))
        return memory._replace(since_s=since_s, seen_s=now_s, command_pa=seen_pa, holding=holding)
    way_m, passed_s = abs(position_m - memory.position_m), now_s - memory.good_s
    inside = settings.low_m < position_m < settings.high_m
    frozen = memory.frozen
    if way_m != 0.0:
        frozen = frozen_of(command_pa=command_pa, pressure_pa=pressure_pa, band=frozen.band)
    elif inside and command_pa != frozen.command_pa and settings.frozen_at < inf:
        needed = needs(frozen.band)
        rests = _rests(frozen, settings, needed, position_m, command_pa=command_pa, pressure_pa=pressure_pa)
        frozen = frozen._replace(
            unanswered_s=frozen.unanswered_s + (0.0 if rests else passed_s),
            longest_s=max(settings.frozen_s, (ANSWERS * needed.answers_s or UNKNOWN_S) + IN_VAIN * passed_s),
            band=needed.band,
        )
    conditions = (
        reference_m is not None and abs(reference_m - position_m) > settings.deviation_m,
        frozen.unanswered_s > frozen.longest_s,
        way_m > settings.rate_m_per_s * passed_s > 0.0,
        inside and not settings.low_pa <= command_pa <= settings.high_pa,
        overrun,
        fast,
    )
    since_s, holding = _held(memory, settings, now_s, conditions)
    return monitoring_of(
        since_s=since_s,
        seen_s=now_s,
        good_s=now_s,
        position_m=position_m,
        frozen=frozen,
        command_pa=seen_pa,
        holding=holding,
    )


def _rests(
    frozen: Frozen,
    settings: MonitorSettings,
    needed: Needs,
    position_m: float,
    *,
    command_pa: float,
    pressure_pa: float,
) -> bool:
    """Whether a stem may rest at a position that has not changed, m, under another command than then."""
    went_pa = abs(command_pa - frozen.command_pa)
    if needed.band is None:
        return went_pa <= max(NOTHING_KNOWN * settings.span_pa, needed.allowed_pa)
    low_pa, high_pa = needed.band.pressures_pa(position_m, settings.frozen_at)
    if not needed.by_law:
        return went_pa <= high_pa - low_pa
    actuator = abs(frozen.pressure_pa - frozen.command_pa) <= ACTUATOR * (high_pa - low_pa)
    measured_pa = pressure_pa if actuator else command_pa
    return max(command_pa, measured_pa) >= low_pa and min(command_pa, measured_pa) <= high_pa


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

"""Commissioning: from commands and a position reading alone to what a daemon's file needs, in under five minutes.

    watch           nothing moves: noise, quantum, creep
    direction       the command creeps until the reading moves by a little, and back
    slow ramps      over the whole range of commands, up and down, at two rates: travel, ends, bench set, spring,
                    friction (`signature`); at such a pace the stem comes to its seat and to its stop
    stroke times    the same way as fast as `[experiment] rate_limit_pa_per_s` permits; how fast the pressure follows
    leak            at half travel the command is held: what creeps
    small steps     dead band, resolution, the smallest move

Each step is a program for the experiments and begins only after the one before came to its end; one that is broken off
ends the commissioning under the command that was in force before it: never by venting.

A reading that falls as the command rises is that of a valve which air closes, for it counts from the closed end.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil, degrees, hypot, isfinite
from typing import Protocol

import numpy as np

from config.codes import ValveTestVerdict
from config.drive import Kind, as_written
from config.experiment_limits import ExperimentLimits
from config.recording import Column, Recording
from config.travel import ActionWord
from positioner.response.figure import Figure, no_value
from positioner.tests_on_the_valve import signature, small_steps
from positioner.tests_on_the_valve.air_rates import air_rates, supply_lacking, verdict_at_rest
from positioner.tests_on_the_valve.outcome import Outcome, Quantity, digits
from positioner.tests_on_the_valve.program import Leap, Player, Program, ramped
from positioner.tests_on_the_valve.ramps import difference, rate_of, scaled
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS
from signals.noise import quantum_m

TEST = "commissioning"
ANGLE_DIGITS = 3
"""Of degrees: what no transmitter resolves."""


class Watching(Player, Protocol):
    """A valve that can be watched, too."""

    def watch(self, for_s: float) -> Recording | None:
        """Return what is measured for a while under the command that is held."""
        ...


@dataclass(frozen=True, slots=True)
class Proposal:
    """A key of the daemon's file with the value that fits, and why."""

    table: str
    key: str
    value: float | str
    reason: str

    def of(self, kind: Kind) -> "Proposal":
        """Return the key and the value that the file of such a valve has."""
        if self.key == "stroke_m" and kind.turns:
            return replace(self, key="travel_deg", value=round(degrees(float(self.value)), ANGLE_DIGITS))
        key, value = as_written(kind, self.key, self.value)
        return self if key == self.key else replace(self, key=key, value=float(f"{value:.6g}"))

    @property
    def line(self) -> str:
        """As it stands in the file."""
        value = f'"{self.value}"' if isinstance(self.value, str) else f"{self.value:.6g}"
        return f"{self.table}.{self.key} = {value}: {self.reason}"


@dataclass(frozen=True, slots=True)
class Commissioned:
    """What was found, and what is proposed; nothing is where it came to nothing."""

    outcome: Outcome
    proposals: tuple[Proposal, ...] = ()


class _Ended(Exception):
    """A step that came to no good end: its verdict and why."""

    def __init__(self, verdict: ValveTestVerdict, why: str) -> None:
        super().__init__(why)
        self.verdict, self.why = verdict, why


def commission(
    valve: Watching, name: str, bounds: ExperimentLimits, show: Callable[[str], None] = lambda _: None
) -> Commissioned:
    """Commission a valve.

    Args:
        valve: on which programs are played.
        name: of the valve.
        bounds: pressures, rate and time that programs stay inside; the travel is not known yet.
        show: told what is done.
    """
    try:
        return _commissioned(valve, name, bounds, show)
    except _Ended as ended:
        return Commissioned(Outcome(TEST, name, (), (ended.verdict,), (ended.why,)))


def _commissioned(valve: Watching, name: str, bounds: ExperimentLimits, show: Callable[[str], None]) -> Commissioned:
    show("watching")
    noise_m, digit_m, creep = _watched(valve.watch(THRESHOLDS.watched_s))
    start_pa = valve.command_pa()
    seen_m = max(THRESHOLDS.seen_sigmas * noise_m, THRESHOLDS.seen_digits * digit_m, THRESHOLDS.seen_m)
    sign = _direction(valve, bounds, start_pa, seen_m, show)
    recordings = _ramps(valve, bounds, start_pa, sign, show)
    if lacking := supply_lacking(recordings):  # a stem that waits for air looks as one on its stop
        raise _Ended(ValveTestVerdict.NO_SUPPLY, lacking)
    found = signature.signature(recordings, signature.Nameplate(name, 1.0))
    if not found.quantities or ValveTestVerdict.NO_SPRING in found.verdicts:
        raise _Ended(found.verdicts[0], found.notes[-1])
    travel, low, high = (found.figure(each) for each in ("travel_m", "low_m", "high_m"))
    if travel.value is None or low.value is None or high.value is None:
        limit = (
            "a higher [pressure] maximum_pa, or more supply," if high.value is None else "a lower [pressure] minimum_pa"
        )
        raise _Ended(ValveTestVerdict.UNDETERMINED, f"{high.reason or low.reason}: {limit} may take it there")
    bench = [found.figure(each) for each in ("bench_low_pa", "bench_high_pa")]
    friction = found.figure("friction_pa")
    ends = (low.value, high.value)
    strokes = _played(valve, _strokes(bounds, start_pa), show)
    up_s, down_s = _stroke_times(strokes, sign, ends, noise_m)
    filling, venting = air_rates(strokes, bounds.rate_pa_per_s)
    half_pa = 0.5 * sum(each.value or 0.0 for each in bench)
    held = (Leap(half_pa, THRESHOLDS.leak_s), Leap(start_pa, 0.5))
    held_still = _played(valve, ramped("leak", start_pa, held, bounds.rate_pa_per_s), show)
    digit_m = max(digit_m, quantum_m(recordings[0].position_m))
    leak = _leak(held_still, sign, digit_m)
    steps = _steps(valve, bounds, start_pa, half_pa, friction, (travel.value, sign, name), show)
    friction = of_one_that_sticks(friction, steps.figure("dead_band_pa"))
    kind = recordings[0].kind
    action: ActionWord = "air_to_open" if sign > 0 else "air_to_close"
    opening, closing = (up_s, down_s) if sign > 0 else (down_s, up_s)
    closed_m = low.value if sign > 0 else -high.value
    adequate, notes = _supply(found, bounds), []
    if adequate.value is not None and adequate.value < THRESHOLDS.supply_margin:
        notes.append("the supply is hardly enough to hold the stem at its upper end")
    if abs(closed_m) > THRESHOLDS.worth_of_span * travel.value:
        notes.append(
            f"the reading at the closed end is {kind.length.said(closed_m)}: its zero is off, set it in the device"
        )
    quantities = (
        Quantity(
            "closed_m", "reading at the closed end", "m", Figure(closed_m, (low if sign > 0 else high).plus_minus)
        ),
        *(
            replace(each, figure=friction) if each.name == "friction_pa" else each
            for each in found.quantities
            if each.name not in LEFT_OUT
        ),
        Quantity("opening_s", "opens within", "s", opening),
        Quantity("closing_s", "closes within", "s", closing),
        Quantity("filling_pa_per_s", "pressure rises by", "Pa/s", filling),
        Quantity("venting_pa_per_s", "pressure falls by", "Pa/s", venting),
        Quantity("supply_margin", "commands above what the upper end needs, of the span", "1", adequate),
        Quantity("leak_m_per_s", "creep with the command held", "m/s", leak),
        *(each for each in steps.quantities if each.name in ("dead_band_pa", "resolution_pa", "least_move_m")),
        Quantity("noise_at_rest_m", "noise at rest", "m", Figure(noise_m)),
        Quantity("digit_m", "digit of the reading", "m", Figure(digit_m)),
        Quantity("creep_m", "creep before anything was commanded", "m", Figure(creep)),
    )
    outcome = Outcome(
        TEST,
        name,
        quantities,
        (ValveTestVerdict.PASSED,),
        (f"more air {'opens' if sign > 0 else 'closes'} it", *notes, *found.notes[-2:-1]),
        found.tables,
        found.picture,
    ).of(kind)
    return Commissioned(outcome, tuple(each.of(kind) for each in _proposals(outcome, action, bounds)))


LEFT_OUT = frozenset({"low_m", "high_m", "noise_m", "friction_at_rate_pa", "dynamic_error_band_mean"})


def _watched(recording: Recording | None) -> tuple[float, float, float]:
    """Return noise, digit and creep of the reading, m."""
    if recording is None or len(recording) < THRESHOLDS.fewest_at_rest:
        raise _Ended(ValveTestVerdict.UNDETERMINED, "no good measurement: positioner doctor says more")
    x, t = recording.position_m, recording.time_s
    creep, noise_m = rate_of(t, x)
    return noise_m, quantum_m(x) or 0.0, (creep.value or 0.0) * float(t[-1] - t[0])


def _played(valve: Watching, program: Program, show: Callable[[str], None]) -> Recording:
    show(f"{program.name}, {program.lasts_s:.0f} s")
    played = valve.play(program)
    if not played.state.played or played.recording is None:
        raise _Ended(
            ValveTestVerdict.BROKEN_OFF, f"{played.problem or 'nothing was recorded'}; the command before is held"
        )
    return played.recording


def _direction(
    valve: Watching, bounds: ExperimentLimits, start_pa: float, moved_m: float, show: Callable[[str], None]
) -> float:
    """Return whether the reading rises, 1, or falls, -1, with the command."""
    rate = (bounds.maximum_pa - bounds.minimum_pa) / THRESHOLDS.creep_s
    first = 1.0 if start_pa < 0.5 * (bounds.minimum_pa + bounds.maximum_pa) else -1.0
    for way in (first, -first):
        limit_pa = bounds.maximum_pa if way > 0 else bounds.minimum_pa
        program = ramped("direction", start_pa, (Leap(start_pa, 1.0), Leap(limit_pa, 0.5)), rate, turn_m=moved_m)
        recording = _played(valve, program, show)
        gone = recording.position_m - float(np.median(recording.position_m[:5]))
        farthest = float(gone[int(np.argmax(np.abs(np.convolve(gone, np.ones(5) / 5.0, "same"))))])
        if abs(farthest) > 0.5 * moved_m:
            return way * float(np.sign(farthest))
    verdict, lacking = verdict_at_rest([recording])
    raise _Ended(verdict, lacking or "over the whole range of commands the reading stands still: stuck, or no supply")


def _ramps(
    valve: Watching, bounds: ExperimentLimits, start_pa: float, sign: float, show: Callable[[str], None]
) -> list[Recording]:
    slow, _, fast = signature.programmes(bounds, start_pa)
    return [_mirrored(_played(valve, each, show), sign) for each in (slow, fast)]


def _mirrored(recording: Recording, sign: float) -> Recording:
    """Return it with a reading that rises with the command."""
    return Recording(dict(recording.columns) | {"position_m": sign * recording.position_m}, recording.metadata)


def _strokes(bounds: ExperimentLimits, start_pa: float) -> Program:
    low, high = bounds.minimum_pa, bounds.maximum_pa
    held_s = THRESHOLDS.stroke_held_s
    leaps = (Leap(low, held_s), Leap(high, held_s), Leap(low, held_s), Leap(start_pa, 0.5))
    return ramped("stroke times", start_pa, leaps, bounds.rate_pa_per_s)


def _stroke_times(
    recording: Recording, sign: float, ends: tuple[float, float], noise_m: float
) -> tuple[Figure, Figure]:
    """Return the times from the change of the command until the stem is there, upwards and downwards, s."""
    t, p, (low, high) = recording.time_s, recording.command_pa, ends
    near_pa, share = 1e-6 * float(np.ptp(p)), (sign * recording.position_m - low) / (high - low)
    at_high = np.flatnonzero(p >= p.max() - near_pa)
    before_up = np.flatnonzero(p[: at_high[0]] <= p.min() + near_pa)
    if not before_up.size:
        lost = no_value("the command did not stay at its ends")
        return lost, lost
    level = min(THRESHOLDS.arrived, 1.0 - THRESHOLDS.arrived_sigmas * noise_m / (high - low))

    def arrival(first: int, gone: Column) -> Figure:
        there = np.flatnonzero(gone[first:] >= level)
        if not there.size:
            return no_value(f"longer than the {THRESHOLDS.stroke_held_s:.3g} s that were waited")
        return Figure(float(t[first + int(there[0])] - t[first]), float(np.median(np.diff(t))))

    return arrival(int(before_up[-1]), share), arrival(int(at_high[-1]), 1.0 - share)


def _leak(recording: Recording, sign: float, digit_m: float) -> Figure:
    """Return how fast the stem creeps while the command is held, m/s."""
    p, t = recording.command_pa, recording.time_s
    held = np.flatnonzero(np.abs(np.diff(p, prepend=p[0])) < 1e-9 * max(1.0, float(np.max(np.abs(p)))))
    runs = np.split(held, np.flatnonzero(np.diff(held) > 1) + 1)
    rows = max(runs, key=len)
    rows = rows[t[rows] >= t[rows[0]] + THRESHOLDS.settling_s]
    if len(rows) < THRESHOLDS.fewest_at_rest:
        return no_value("too few samples under the command held")
    creep, _ = rate_of(t[rows], sign * recording.position_m[rows])
    unseen_m_per_s = digit_m / float(t[rows[-1]] - t[rows[0]])
    return replace(creep, plus_minus=max(creep.plus_minus or 0.0, unseen_m_per_s))


def _steps(
    valve: Watching,
    bounds: ExperimentLimits,
    start_pa: float,
    half_pa: float,
    friction: Figure,
    of: tuple[float, float, str],
    show: Callable[[str], None],
) -> Outcome:
    """Return the outcome of small steps about half travel."""
    travel_m, sign, name = of
    asked = small_steps.SmallSteps(max(1.0, 2.0 * (friction.value or 0.0)))
    program = small_steps.programme(replace(asked, most=0.9), bounds, half_pa, travel_m)
    way_s = abs(half_pa - start_pa) / bounds.rate_pa_per_s
    shifted = tuple((way_s + 1e-3 + time_s, pressure_pa) for time_s, pressure_pa in program.points)
    points = ((0.0, start_pa), *shifted, (shifted[-1][0] + way_s + 1e-3, start_pa))
    recording = _played(valve, Program("small steps", points), show)
    return small_steps.small_steps(_mirrored(recording, sign), name, travel_m)


def of_one_that_sticks(friction: Figure, dead_band: Figure) -> Figure:
    """Return friction as it is known beside a dead band, which is twice what the stem breaks loose at.

    A stem that slides through the ramps in part shows less than one that sticks: that is the mean of where it breaks
    loose and of where it stops, and it stops at no more than the ramps show.
    """
    if friction.value is None or dead_band.value is None:
        return friction
    open_pa = 0.5 * max(0.0, 0.5 * dead_band.value - friction.value)
    return replace(friction, plus_minus=hypot(friction.plus_minus or 0.0, open_pa))


def _supply(found: Outcome, bounds: ExperimentLimits) -> Figure:
    """Return the commands above what takes the stem to its upper end, over the bench set's span."""
    low, high, friction = (found.figure(each) for each in ("bench_low_pa", "bench_high_pa", "friction_pa"))
    span = difference(high, low)
    if span.value is None or friction.value is None:
        return no_value("the bench set is not known")
    needed = difference(high, scaled(friction, -1.0))
    return scaled(difference(Figure(bounds.maximum_pa, 0.0), needed), 1.0 / span.value)


def _proposals(outcome: Outcome, action: ActionWord, bounds: ExperimentLimits) -> list[Proposal]:
    travel, slope, friction = (outcome.figure(each) for each in ("travel_m", "spring_pa_per_m", "friction_pa"))
    low, high = (outcome.figure(each) for each in ("bench_low_pa", "bench_high_pa"))
    opens = action == "air_to_open"
    told = [
        Proposal("valve", "stroke_m", _rounded(travel.value, travel.plus_minus), "the travel from end to end"),
        Proposal("valve", "action", action, f"the reading {'rises' if opens else 'falls'} with the command"),
    ]
    if high.value is not None and low.value is not None and friction.value is not None:
        enough_pa = high.value + friction.value + THRESHOLDS.pressed * (high.value - low.value)
        enough_pa = THRESHOLDS.rounded_pa * ceil(enough_pa / THRESHOLDS.rounded_pa)
        if enough_pa < bounds.maximum_pa:
            why = "takes the stem to its upper end and presses it there by 15 % of the bench set"
            told.append(Proposal("pressure", "maximum_pa", enough_pa, why))
    if slope.value and low.value is not None and friction.value and isfinite(slope.value):
        # The law counts from the low end of the stem, where the reading of a valve may be off its zero.
        closed_m = outcome.figure("closed_m").value or 0.0
        at_zero_pa = low.value - (1.0 if opens else -1.0) * slope.value * closed_m
        spring, held = _rounded(slope.value, slope.plus_minus), _rounded(friction.value, friction.plus_minus)
        told += [
            Proposal("law", "b_over_c_pa_per_m", -spring, "less the spring rate, as a pressure"),
            Proposal("law", "k_over_c_pa", -held, "less the friction, as a pressure"),
            Proposal("law", "offset_pa", _rounded(at_zero_pa, low.plus_minus), "the bench set's lower end"),
        ]
    return told


def _rounded(value: float | None, plus_minus: float | None) -> float:
    """Return a value to the digit that its uncertainty leaves, and one more.

    >>> _rounded(0.0400437, 0.0001), _rounded(1999312.0, 4100.0)
    (0.04004, 1999300.0)
    """
    assert value is not None
    if not plus_minus:
        return float(f"{value:.6g}")
    return round(value, digits(plus_minus))

"""The partial stroke test: the stem is moved by a part of its travel and brought back, to see that it still can.

    held        the command in force, 2 s: where the stem rests, and its noise
    out         a ramp of the command towards the threshold, slow, or as fast as the rate limit permits ("step")
    turn        where the stem has gone by the travel asked for: the way so far, backwards
    held        2 s

Abort: beyond the band about the start (travel and `beyond`), by the travel window, by the time limit, by the DCS
(consent, veto, mode); the way back is the experiment's. Limits come from a reference that was kept:

    friction high, low      friction over the reference's, beyond `[health] friction_high`, `friction_low`; where either
                            has none, break-out over the reference's, if both began under the same command
    slow                    time from the break-out to the travel over the reference's, above `slow`

each beyond its own +-. Break-out is counted from the command in force: a stem that is pressed onto its stop needs more.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import hypot

import numpy as np

from config.codes import ExperimentState, ValveTestVerdict
from config.errors import InputError
from config.experiment_limits import ExperimentLimits
from config.recording import Recording
from positioner.response.figure import Figure, no_value
from positioner.tests_on_the_valve.air_rates import verdict_at_rest
from positioner.tests_on_the_valve.breakout import (
    Breakout,
    Rest,
    breakout,
    farthest,
    rest_after,
    rest_before,
    tolerance_m,
)
from positioner.tests_on_the_valve.outcome import Curve, Outcome, Picture, Quantity
from positioner.tests_on_the_valve.program import SHORTEST_S, Leap, Played, Program, ramped, require_within
from positioner.tests_on_the_valve.ramps import difference, legs_of, ramps_of
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS

TEST = "partial stroke test"


@dataclass(frozen=True, slots=True)
class PartialStroke:
    """What is asked for: shares of the stroke, Pa.

    Attributes:
        travel: how far the stem is moved.
        beyond: how much farther it may go before the test is broken off.
        least: how far it must go at the least to pass.
        start: motion that counts as a break-out.
        opening: whether towards more pressure; None: away from the nearer end of the travel.
        fast: a step, as fast as the rate limit permits, in place of a ramp.
        threshold_pa: the command is never taken beyond; None: to the limit of the experiments.
    """

    travel: float = 0.1
    beyond: float = 0.05
    least: float = 0.08
    start: float = 0.005
    opening: bool | None = None
    fast: bool = False
    threshold_pa: float | None = None

    def require_possible(self) -> None:
        """Refuse what cannot be; InputError as `require_within`."""
        require_within(
            (
                ("--travel", self.travel, 0.01, 0.5),
                ("--beyond", self.beyond, 0.005, 0.5),
                ("--least", self.least, 0.0, self.travel),
                ("--start", self.start, 1e-4, 0.5 * self.travel),
            ),
            " of the stroke",
        )


def programme(
    asked: PartialStroke,
    bounds: ExperimentLimits,
    start_pa: float,
    stem_m: float,
    stroke_m: float,
    source: str = "experiment",
) -> Program:
    """Return the program of the test.

    Raises:
        InputError: the threshold is not between the command and its limit, or the time limit is too short.
    """
    asked.require_possible()
    opening = stem_m < 0.5 * stroke_m if asked.opening is None else asked.opening
    limit_pa = bounds.maximum_pa if opening else bounds.minimum_pa
    threshold_pa = limit_pa if asked.threshold_pa is None else asked.threshold_pa
    way = 1.0 if opening else -1.0
    if not 0.0 < way * (threshold_pa - start_pa) <= way * (limit_pa - start_pa):
        raise InputError(
            "--threshold-pa",
            f"allowed is beyond the command in force, {start_pa:g} Pa, up to the limit {limit_pa:g} Pa, "
            f"got {threshold_pa:g}",
        )
    way_pa, spare_s = abs(threshold_pa - start_pa), 2.0 * THRESHOLDS.rest_s
    within_s = max(SHORTEST_S, THRESHOLDS.of_time_limit * bounds.longest_s - spare_s)
    slow = (bounds.maximum_pa - bounds.minimum_pa) / THRESHOLDS.slowest_leg_s
    rate = bounds.rate_pa_per_s if asked.fast else min(bounds.rate_pa_per_s, max(slow, way_pa / within_s))
    if (needed_s := way_pa / rate + spare_s) > bounds.longest_s:
        raise InputError(source, f"experiment.limit_s: this test needs {needed_s:.3g} s, got {bounds.longest_s:g}")
    leaps = (Leap(start_pa, THRESHOLDS.rest_s), Leap(threshold_pa, 0.0))
    turn_m = asked.travel * stroke_m
    return ramped(TEST, start_pa, leaps, rate, turn_m=turn_m, band_m=turn_m + asked.beyond * stroke_m)


def partial_stroke(
    played: Played,
    asked: PartialStroke,
    valve: str,
    stroke_m: float,
    reference: Outcome | None = None,
    friction_limits: tuple[float, float] = (0.5, 1.5),
) -> Outcome:
    """Return what a test came to.

    Args:
        played: the recording, and what became of the experiment.
        asked: what was asked for.
        valve: its name.
        stroke_m: its stroke.
        reference: a test of the same kind that was kept.
        friction_limits: over the reference, low and high; 0 is no limit.
    """
    recording = played.recording
    rest = None if recording is None else rest_before(recording)
    broken_off = played.broken_off
    if recording is None or rest is None:
        verdict = broken_off or [ValveTestVerdict.UNDETERMINED]
        why = played.problem or "too few samples of the rest before it"
        return Outcome(TEST, valve, (), tuple(verdict), (why,))
    tolerance, after = tolerance_m(asked.start * stroke_m, rest), rest_after(recording)
    found = breakout(recording, rest, tolerance)
    travel = farthest(recording, rest)
    quantities = _figures(recording, rest, after, found, travel, asked, stroke_m, played.state)
    verdicts = [
        *broken_off,
        *_verdicts(rest, found, travel, asked, stroke_m, tolerance, played.state, after),
    ]
    notes = [f"broken off: {played.problem}"] if broken_off else []
    if found is None and played.state is ExperimentState.COMPLETE:
        still, lacking = verdict_at_rest([recording])
        verdicts.append(still)
        notes += [lacking] if lacking else []
    if tolerance > asked.start * stroke_m:
        notes.append(f"the start tolerance is {recording.kind.length.said(tolerance)}, because of the noise")
    if after is not None and not broken_off and abs(after.position_m - rest.position_m) > tolerance:
        notes.append("the stem is not quite where it was: friction holds it, and the law takes it back")
    if reference is None:
        notes.append("no reference: friction and times are not judged; --keep as_left makes this one the reference")
    else:
        verdicts += list(_against({each.name: each.figure for each in quantities}, reference, friction_limits))
    return Outcome(
        TEST,
        valve,
        tuple(quantities),
        tuple(dict.fromkeys(verdicts)) or (ValveTestVerdict.PASSED,),
        tuple(notes),
        picture=_picture(recording),
    ).of(recording.kind)


def _verdicts(
    rest: Rest,
    found: Breakout | None,
    travel: Figure,
    asked: PartialStroke,
    stroke_m: float,
    tolerance: float,
    state: ExperimentState,
    after: Rest | None,
) -> Iterator[ValveTestVerdict]:
    if abs(rest.creep_m) > tolerance:
        yield ValveTestVerdict.DEVIATION
    if found is None:
        return
    if state is ExperimentState.COMPLETE:
        yield ValveTestVerdict.PRESSURE_THRESHOLD
    if travel.value is not None and travel.value < asked.least * stroke_m:
        yield ValveTestVerdict.TRAVEL_NOT_REACHED
    if travel.value is not None and travel.value > (asked.travel + asked.beyond) * stroke_m:
        yield ValveTestVerdict.TRAVEL_EXCEEDED
    at_an_end = not THRESHOLDS.at_an_end * stroke_m < rest.position_m < (1.0 - THRESHOLDS.at_an_end) * stroke_m
    if at_an_end and after is not None and abs(after.position_m - rest.position_m) > tolerance:
        yield ValveTestVerdict.NOT_SEATED


def _figures(
    recording: Recording,
    rest: Rest,
    after: Rest | None,
    found: Breakout | None,
    travel: Figure,
    asked: PartialStroke,
    stroke_m: float,
    state: ExperimentState,
) -> list[Quantity]:
    still = no_value("the stem did not break loose")
    time_s, command_pa = recording.time_s, recording.command_pa
    begins = max(0, rest.rows - 1)
    gap_s = float(np.median(np.diff(time_s)))
    out_pa, out_s, within = still, still, still
    if found is not None:
        out_pa = Figure(abs(found.command_pa - float(command_pa[begins])), found.plus_minus_pa)
        out_s = Figure(found.time_s - float(time_s[begins]), gap_s)
        within = _time_to(recording, rest, found, asked.travel * stroke_m, gap_s, state)
    friction = _friction(recording, rest, after, state)
    unrested = no_value("broken off, or too few samples of the rest after it")
    off = unrested
    if after is not None and state.played:
        off = Figure(after.position_m - rest.position_m, hypot(after.error_m, rest.error_m))
    return [
        Quantity("command_pa", "command in force before it", "Pa", Figure(float(command_pa[0]))),
        Quantity("start_m", "where the stem rested", "m", Figure(rest.position_m, rest.error_m)),
        Quantity("breakout_pa", "break-out, from the command in force", "Pa", out_pa),
        Quantity("breakout_s", "time to the break-out", "s", out_s),
        Quantity("reached_m", "travel reached", "m", travel, asked.travel * stroke_m),
        Quantity("stroke_s", "time from the break-out to the travel", "s", within),
        Quantity("friction_at_rate_pa", "friction as a pressure, with the lag", "Pa", friction),
        Quantity("back_m", "back at, from where it was", "m", off),
        Quantity("noise_m", "noise at rest", "m", Figure(rest.noise_m)),
    ]


def _time_to(
    recording: Recording, rest: Rest, found: Breakout, travel_m: float, gap_s: float, state: ExperimentState
) -> Figure:
    if state is not ExperimentState.TURNED:
        return no_value("the travel was not reached")
    gone = found.way * (recording.position_m - rest.position_m)
    reached = np.flatnonzero(gone[found.row :] >= travel_m - rest.noise_m)
    if not reached.size:
        return no_value("the travel was not reached")
    return Figure(float(recording.time_s[found.row + int(reached[0])]) - found.time_s, 2.0 * gap_s)


def _friction(recording: Recording, rest: Rest, after: Rest | None, state: ExperimentState) -> Figure:
    """Return the half distance of the lines of both ways, midway on the part of the travel that both went."""
    if state is not ExperimentState.TURNED or after is None:
        return no_value("the stem was not moved there and back")
    ramps, x = ramps_of(legs_of(recording)), recording.position_m
    turn_m = float(x[int(np.argmax(np.abs(x - rest.position_m)))])
    up, down = (ramps.at_slowest(way, 0.5 * (turn_m + after.position_m)) for way in (1, -1))
    return difference(up, down, 0.5)


def _against(now: dict[str, Figure], reference: Outcome, limits: tuple[float, float]) -> Iterator[ValveTestVerdict]:
    low, high = limits
    then = {each.name: each.figure for each in reference.quantities}
    friction = _both(now, then, "friction_at_rate_pa")
    if friction is None and (command := _both(now, then, "command_pa")) is not None:
        after, _, before = command
        alike = abs(after - before) <= THRESHOLDS.same_command * max(abs(before), abs(after))
        friction = _both(now, then, "breakout_pa") if alike else None
    if friction is not None:
        value, error, was = friction
        if high and value - error > high * was:
            yield ValveTestVerdict.FRICTION_HIGH
        if low and value + error < low * was:
            yield ValveTestVerdict.FRICTION_LOW
    if (stroke := _both(now, then, "stroke_s")) is not None and stroke[0] - stroke[1] > THRESHOLDS.slow * stroke[2]:
        yield ValveTestVerdict.SLOW


def _both(now: dict[str, Figure], then: dict[str, Figure], name: str) -> tuple[float, float, float] | None:
    """Return a figure, its +-, and what it was; None where it cannot be compared."""
    figure, was = now[name], then.get(name, no_value("")).value
    return (figure.value, figure.plus_minus or 0.0, was) if figure.value is not None and was else None


def _picture(recording: Recording) -> Picture:
    return Picture.of_travel(recording.kind, (Curve("there and back", recording.command_pa, recording.position_m),))

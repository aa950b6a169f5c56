"""An experiment played on the valve: a sequence of times and pressures, beside the sine and the staircase of S3.

    approach    from the command in force to the first pressure, at the rate limit
    play        straight from each pressure to the next; t = 0 is the end of the approach
    turn        where the stem has gone as far as was asked: the way so far, backwards, at its own pace
    return      at the rate limit to the command that was in force before: the law, which has not moved, goes on there

Travel is counted from where the stem was at the start, and by the median of the last samples: one that a noise throws
far neither turns it nor breaks it off.

It begins by a start written in automatic with the consent of the DCS, no veto, eta_1 = 1, a good measurement inside the
travel window, and a sequence whose pressures, rates and length are inside the limits; a start that is refused does not
come later by itself. It is broken off, by the way back, when consent is withdrawn, a veto comes or the stem leaves the
window or the experiment's own band; at once, without a way back, by another mode, by eta_1 = 0 and by a fault, whose
safe action commands.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median

from config.codes import ExperimentState, Fault, Mode
from config.experiment_limits import ExperimentLimits
from positioner.control.permissives import missing
from positioner.control.requests import ExperimentRequest

COUNTED = 5
"""Samples whose median is where the stem is: two that noise throws far are outvoted."""
COMMANDING = (ExperimentState.UNDER_WAY, ExperimentState.RETURNING)
ROUNDING = 1e-3
"""Of the rate and the length: times and pressures come as float32."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What permits an experiment: `position_m` is of the last good measurement, None before the first."""

    now_s: float
    mode: Mode
    fault: Fault
    excited: bool
    """Whether eta_1 asks for another excitation."""
    position_m: float | None
    command_pa: float
    """The last command given."""
    held_pa: float
    """What it returns to."""


@dataclass(frozen=True, slots=True)
class PlayedExperiment:
    """The experiment under way, or what became of the last one."""

    state: ExperimentState = ExperimentState.NONE
    starts: int = 0
    """Starts that have been taken note of."""
    sequence: tuple[tuple[float, float], ...] = ()
    """Times from the start of the approach, s, and pressures, Pa; the first is where the approach begins."""
    begin_s: float = 0.0
    held_pa: float = 0.0
    after: ExperimentState = ExperimentState.COMPLETE
    """What it will have come to when it is back."""
    turn_m: float = 0.0
    """Travel at which it retraces its way; 0 never, or no more."""
    band_m: float = 0.0
    """Travel that breaks it off; 0 none."""
    from_m: float = 0.0
    """Where the stem was at the start."""
    last_m: tuple[float, ...] = ()
    """The last positions."""

    @property
    def travelled_m(self) -> float:
        """How far the stem is from where it was at the start, m."""
        return abs(median(self.last_m) - self.from_m) if self.last_m else 0.0

    @property
    def commands(self) -> bool:
        """Whether it commands the pressure."""
        return self.state in COMMANDING

    def is_idle(self, request: ExperimentRequest) -> bool:
        """Whether nothing is under way, and nothing is asked for that was not yet taken note of."""
        return request.starts == self.starts and not self.commands

    def elapsed_s(self, now_s: float) -> float:
        """Return the time since the end of the approach; 0 before it and where none is under way."""
        if self.state is not ExperimentState.UNDER_WAY:
            return 0.0
        return max(0.0, now_s - self.begin_s - self.sequence[1][0])

    def pressure_pa(self, now_s: float) -> float:
        """Return the pressure at a time, Pa."""
        at_s = now_s - self.begin_s
        for (before_s, before_pa), (after_s, after_pa) in pairwise(self.sequence):
            if at_s < after_s:
                part = max(0.0, at_s - before_s) / (after_s - before_s)
                return before_pa + part * (after_pa - before_pa)
        return self.sequence[-1][1]


def experiment_after(
    before: PlayedExperiment, request: ExperimentRequest, around: Surroundings, limits: ExperimentLimits
) -> PlayedExperiment:
    """Return the experiment after one more step, where it is not idle."""
    here = replace(before, starts=request.starts)
    if not here.commands:
        return _started(here, request, around, limits)
    if (ended := _not_ours(around)) is not ExperimentState.NONE:
        return replace(here, state=ended)
    over = around.now_s - here.begin_s >= here.sequence[-1][0]
    if here.state is ExperimentState.RETURNING:
        return replace(here, state=here.after) if over else here
    here = _followed(here, around)
    stopped = _withdrawn(request, around, limits) or _beyond_band(here)
    if stopped is not ExperimentState.NONE or over:
        return _returning(here, stopped, around, limits)
    return _retracing(here, around) if 0.0 < here.turn_m <= here.travelled_m else here


def _followed(here: PlayedExperiment, around: Surroundings) -> PlayedExperiment:
    """Return it with where the stem is now, if it asks how far that has gone."""
    if around.position_m is None or not (here.turn_m or here.band_m):
        return here
    return replace(here, last_m=(*here.last_m[1 - COUNTED :], around.position_m))


def _beyond_band(here: PlayedExperiment) -> ExperimentState:
    return ExperimentState.BEYOND_BAND if 0.0 < here.band_m < here.travelled_m else ExperimentState.NONE


def _retracing(here: PlayedExperiment, around: Surroundings) -> PlayedExperiment:
    """Return it on the way that it has come, backwards."""
    so_far_s = around.now_s - here.begin_s
    passed = [(so_far_s - at_s, pressure_pa) for at_s, pressure_pa in here.sequence if at_s < so_far_s]
    return replace(
        here,
        sequence=((0.0, around.command_pa), *reversed(passed)),
        begin_s=around.now_s,
        after=ExperimentState.TURNED,
        turn_m=0.0,
    )


def _started(
    here: PlayedExperiment, request: ExperimentRequest, around: Surroundings, limits: ExperimentLimits
) -> PlayedExperiment:
    refused = _refusal(request, around, limits)
    if refused is not ExperimentState.NONE:
        return replace(here, state=refused)
    approach_s = _way_s(around.command_pa, request.points[0][1], limits)
    played = tuple((approach_s + time_s, pressure_pa) for time_s, pressure_pa in request.points)
    return replace(
        here,
        state=ExperimentState.UNDER_WAY,
        sequence=((0.0, around.command_pa), *played),
        begin_s=around.now_s,
        held_pa=around.held_pa,
        after=ExperimentState.COMPLETE,
        turn_m=request.turn_m,
        band_m=request.band_m,
        from_m=around.position_m or 0.0,
        last_m=(),
    )


def _returning(
    here: PlayedExperiment, stopped: ExperimentState, around: Surroundings, limits: ExperimentLimits
) -> PlayedExperiment:
    back = (_way_s(around.command_pa, here.held_pa, limits), here.held_pa)
    after = here.after if stopped is ExperimentState.NONE else stopped
    return replace(
        here,
        state=ExperimentState.RETURNING,
        sequence=((0.0, around.command_pa), back),
        begin_s=around.now_s,
        after=after,
    )


def _way_s(from_pa: float, to_pa: float, limits: ExperimentLimits) -> float:
    return abs(to_pa - from_pa) / limits.rate_pa_per_s


def _refusal(request: ExperimentRequest, around: Surroundings, limits: ExperimentLimits) -> ExperimentState:
    """Return why an experiment may not begin; NONE if it may."""
    unmeasured = ExperimentState.NO_MEASUREMENT if around.position_m is None else ExperimentState.NONE
    stopped = _not_ours(around) or unmeasured or _withdrawn(request, around, limits)
    return stopped or _problem(request.points, around.command_pa, limits)


def _not_ours(around: Surroundings) -> ExperimentState:
    """Return why the command is another's; NONE if it is the experiment's."""
    if around.fault is not Fault.NONE:
        return ExperimentState.FAULT
    if around.mode is not Mode.AUTOMATIC:
        return ExperimentState.NOT_AUTOMATIC
    return ExperimentState.EXCITED if around.excited else ExperimentState.NONE


def _withdrawn(request: ExperimentRequest, around: Surroundings, limits: ExperimentLimits) -> ExperimentState:
    lacking = missing(
        consented=request.consented,
        vetoed=request.vetoed,
        position_m=around.position_m,
        window_m=(limits.low_m, limits.high_m),
    )
    return ExperimentState.NONE if lacking is None else lacking.experiment


def _problem(points: tuple[tuple[float, float], ...], command_pa: float, limits: ExperimentLimits) -> ExperimentState:
    """Return what is wrong with a sequence; NONE if nothing is."""
    times_s = [time_s for time_s, _ in points]
    ordered = all(before < after for before, after in pairwise(times_s))
    if len(points) < 2 or times_s[0] != 0.0 or not ordered or not all(map(math.isfinite, sum(points, ()))):
        return ExperimentState.NO_SEQUENCE
    if not all(limits.minimum_pa <= pressure_pa <= limits.maximum_pa for _, pressure_pa in points):
        return ExperimentState.BEYOND_PRESSURE
    fastest = limits.rate_pa_per_s * (1.0 + ROUNDING)
    if any(abs(b[1] - a[1]) > fastest * (b[0] - a[0]) for a, b in pairwise(points)):
        return ExperimentState.TOO_FAST
    if times_s[-1] + _way_s(command_pa, points[0][1], limits) > limits.longest_s * (1.0 + ROUNDING):
        return ExperimentState.TOO_LONG
    return ExperimentState.NONE

"""What a stem does after one step of its input, by the names of ISA-75.25.01 and IEC 60534-4.

With x_0 where the stem rests before the step, x_1 where it rests at the end, y = (x - x_0) / (x_1 - x_0):

    dead time T_d    from the step until a response can be observed: y passes 5 σ of the noise, and 0.005
    T63              until y passes 0.632 (1 - 1/e); the dead time is part of it
    T86              until y passes 0.865 (1 - 1/e^2), the step response time; the dead time is part of it
    overshoot        how far y goes beyond 1, in %
    travel           x_1 - x_0
    static gain      travel over the step of the input (travel gain)
    final error      x_1 less the reference, where the input is one

Times cannot be determined of a move below 25 σ (T86 then drowns in noise), of a stem that was not at rest before or at
the end, or across a gap of the recording; nor T63 or T86 of which fewer than 5 samples lie within it: half a sample is
what a passage between two samples is known to, a tenth of such a time. Where T63 is not resolved, the dead time and
the overshoot are not.
"""

from dataclasses import dataclass
from math import hypot, sqrt

import numpy as np

from config.recording import Column
from config.results.result import Brief
from positioner.response.figure import Figure, no_value
from positioner.response.level_crossing import LevelCrossing, level_crossing
from positioner.response.rest_level import RestLevel, rest_at_the_end
from positioner.response.step_detection import StepChange

T63, T86 = 0.632, 0.865  # shares of the travel, ISA-75.25.01
OBSERVABLE_SIGMA = 5.0  # of the noise: less is no response
OBSERVABLE_PERCENT = 0.5
SMALLEST_SIGMA = 25.0  # of the noise: a smaller move has no times
DRIFT = 0.01
"""A stem that still moves by this part of the move has not settled."""
FEWEST_WITHIN = 5
"""Samples that a response time must span."""
TOO_FAR_APART = "the samples are too far apart"
GAP_PERIODS = 3.0
"""A gap between samples wider than this many of their median periods is a gap."""


@dataclass(frozen=True, slots=True, repr=False)
class StepFigures(Brief):
    """Figures of one step, SI units; the input in m (reference) or Pa (command)."""

    time_s: float
    input_from: float
    input_to: float
    moved: bool
    """Whether the stem rests elsewhere after the step, beyond what noise does."""
    level_m: float | None
    """Where the stem rests at the end."""
    noise_m: float | None
    travel_m: Figure
    static_gain: Figure
    dead_time_s: Figure
    t63_s: Figure
    t86_s: Figure
    overshoot_percent: Figure
    final_error_m: Figure

    @property
    def size(self) -> float:
        """Change of the input, signed."""
        return self.input_to - self.input_from


TIMED = ("dead_time_s", "t63_s", "t86_s", "overshoot_percent")
FIGURES = ("travel_m", "static_gain", *TIMED, "final_error_m")


def figures_of(
    time_s: Column, position_m: Column, step: StepChange, quantum_m: float, *, is_reference: bool
) -> StepFigures:
    """Return the figures of one step of a recording, (n,), s and finite positions in m."""
    start_s = float(time_s[step.first])
    before = rest_at_the_end(time_s[step.before : step.first], position_m[step.before : step.first], quantum_m)
    after = rest_at_the_end(time_s[step.first : step.end], position_m[step.first : step.end], quantum_m)
    if before is None or after is None:
        return _step_without_figures(start_s, step, "too few samples before or after the step")
    std_m = hypot(before.level_std_m, after.level_std_m)
    travel_m = after.level_m - before.level_m
    moved = abs(travel_m) > max(OBSERVABLE_SIGMA * std_m, 1.5 * quantum_m)
    error = Figure(after.level_m - step.to, after.level_std_m) if is_reference else no_value("the input is a pressure")
    timed = _measure_times(time_s, position_m, step, before, after) if moved else _all(TIMED, "the stem did not move")
    return StepFigures(
        time_s=start_s,
        input_from=step.from_,
        input_to=step.to,
        moved=moved,
        level_m=after.level_m,
        noise_m=max(before.noise_m, after.noise_m),
        travel_m=Figure(travel_m, std_m),
        static_gain=Figure(travel_m / step.size, std_m / abs(step.size)),
        final_error_m=error,
        **timed,
    )


def _step_without_figures(start_s: float, step: StepChange, reason: str) -> StepFigures:
    return StepFigures(start_s, step.from_, step.to, False, None, None, **_all(FIGURES, reason))


def _all(names: tuple[str, ...], reason: str) -> dict[str, Figure]:
    return dict.fromkeys(names, no_value(reason))


def _measure_times(
    time_s: Column, position_m: Column, step: StepChange, before: RestLevel, after: RestLevel
) -> dict[str, Figure]:
    """Return the times and the overshoot."""
    travel_m = after.level_m - before.level_m
    noise = max(before.noise_m, after.noise_m) / abs(travel_m)
    if reason := _reason_untimed(time_s, step, before, after, noise):
        return _all(TIMED, reason)
    t = time_s[step.first : step.end] - time_s[step.first]
    y = (position_m[step.first : step.end] - before.level_m) / travel_m
    period_s = float(np.median(np.diff(t)))
    observable = max(OBSERVABLE_SIGMA * noise, OBSERVABLE_PERCENT / 100)
    times = {
        name: _time(level_crossing(t, y, level, noise), period_s, 0 if name == "dead_time_s" else FEWEST_WITHIN)
        for name, level in (("dead_time_s", observable), ("t63_s", T63), ("t86_s", T86))
    }
    if (reason := times["t63_s"].reason or "").startswith(TOO_FAR_APART):
        return times | _all(("dead_time_s", "overshoot_percent"), reason)
    return times | {"overshoot_percent": _overshoot(t, y, noise)}


def _reason_untimed(time_s: Column, step: StepChange, before: RestLevel, after: RestLevel, noise: float) -> str | None:
    """Return why no time can be determined of a step whose stem moved; None when it can."""
    if noise * SMALLEST_SIGMA > 1:
        return f"the move is {1 / noise:.0f} times its rests' scatter, determined from {SMALLEST_SIGMA:.0f} times up"
    for rest, when in ((before, "at rest before the step"), (after, "settled before the hold ended")):
        allowed_m = max(6 * rest.level_std_m, DRIFT * abs(after.level_m - before.level_m))
        if abs(rest.drift_m) > allowed_m:
            return f"the stem had not {'been ' if rest is before else ''}{when}"
    around_s = np.diff(time_s[step.before : step.end])
    gap_s = float(time_s[step.first] - time_s[step.first - 1])
    if gap_s > GAP_PERIODS * float(np.median(around_s)):
        return f"the recording has a gap of {gap_s:.3g} s before the step"
    return None


def _time(crossing: LevelCrossing | None, period_s: float, fewest_within: int) -> Figure:
    """Return when a level was passed, or why that is not known; `fewest_within` samples must lie within that time."""
    if crossing is None:
        return no_value(f"{TOO_FAR_APART}: the stem was past it at the first")
    early_s, late_s = max(crossing.time_s - crossing.gap_s, 0.0), crossing.time_s + crossing.gap_s
    if crossing.gap_s > GAP_PERIODS * period_s and crossing.plus_minus_s > 0.1 * crossing.time_s:
        return no_value(f"a gap of {crossing.gap_s:.3g} s in the samples: between {early_s:.3g} and {late_s:.3g} s")
    if crossing.time_s < fewest_within * period_s:
        return no_value(f"{TOO_FAR_APART}, {period_s:.3g} s: T63 and T86 must take {fewest_within} of them")
    return Figure(crossing.time_s, crossing.plus_minus_s)


def _overshoot(t: Column, y: Column, noise: float) -> Figure:
    """Return how far y goes beyond 1, in %: the top of a parabola through the upper half of its highest peak."""
    top = int(y.argmax())
    height = float(y[top]) - 1.0
    if height <= OBSERVABLE_SIGMA * noise:
        return Figure(0.0, 100 * OBSERVABLE_SIGMA * noise)
    low = np.flatnonzero(y <= 1.0 + height / 2)
    left, right = low[low < top], low[low > top]
    peak = slice(int(left[-1]) + 1 if left.size else 0, int(right[0]) if right.size else len(y))
    count = peak.stop - peak.start
    if count < 5:
        return Figure(100 * height, 100 * noise)
    parabola = np.polynomial.Polynomial.fit(t[peak], y[peak], 2)
    fitted = float(parabola(np.linspace(t[peak][0], t[peak][-1], 200)).max()) - 1.0
    return Figure(100 * fitted, 100 * max(1.5 * noise / sqrt(count), abs(height - fitted) / 2 if noise == 0 else 0.0))

"""Where a stem that rests under a command breaks loose when the command goes off, and where it then goes.

    x_0, sigma      mean and scatter of the position while the command is held
    break-out       the first of three samples in a row beyond a tolerance about x_0, all on one side
    ± of its command    how far the command goes from the sample before to the third

Two samples beyond are noise more often than a stem; the tolerance is never less than 5 sigma.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np
from numpy.typing import NDArray

from config.recording import Column, Recording
from positioner.response.figure import Figure, no_value
from positioner.tests_on_the_valve.ramps import rate_of
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS
from signals.noise import quantum_m


@dataclass(frozen=True, slots=True)
class Rest:
    """Where the stem rests, its scatter, how far it creeps over the rest, the reading's digit, m; rows of the rest."""

    position_m: float
    noise_m: float
    creep_m: float
    digit_m: float
    rows: int

    @property
    def error_m(self) -> float:
        """Two standard deviations of the mean, m; a digit that does not flicker is not averaged out."""
        return 2.0 * max(self.noise_m / sqrt(self.rows), self.digit_m / sqrt(12.0))


@dataclass(frozen=True, slots=True)
class Breakout:
    """When and under which command the stem broke loose, and its way."""

    row: int
    time_s: float
    command_pa: float
    plus_minus_pa: float
    way: int


def rest_before(recording: Recording) -> Rest | None:
    """Return the rest under the first command; None where there are too few samples of it."""
    off = _off(recording.command_pa, 0)
    return _rest(recording, 0, int(off[0]) if off.size else len(recording))


def rest_after(recording: Recording) -> Rest | None:
    """Return the rest under the command that is held at the end."""
    off, last = _off(recording.command_pa, -1), len(recording)
    first = int(off[-1]) + 1 if off.size else 0
    # What is left of the slide back is no rest: its first half is left out.
    return _rest(recording, first + (last - first) // 2, last)


def _off(command_pa: Column, row: int) -> NDArray[np.intp]:
    """Return the rows whose command is another than that of a row."""
    held_pa = float(command_pa[row])
    return np.flatnonzero(np.abs(command_pa - held_pa) > THRESHOLDS.command_changed * max(1.0, abs(held_pa)))


def tolerance_m(asked_m: float, rest: Rest) -> float:
    """Return the tolerance that is used: what was asked for, or what the noise needs."""
    return max(asked_m, THRESHOLDS.moved_sigmas * rest.noise_m)


def breakout(recording: Recording, rest: Rest, tolerance: float) -> Breakout | None:
    """Return where the stem broke loose; None where it did not."""
    off = recording.position_m - rest.position_m
    side = (off > tolerance).astype(int) - (off < -tolerance)
    if len(side) < rest.rows + THRESHOLDS.in_a_row:
        return None
    runs = np.abs(np.convolve(side[rest.rows :], np.ones(THRESHOLDS.in_a_row), "valid")) >= THRESHOLDS.in_a_row
    if not runs.any():
        return None
    row = rest.rows + int(np.argmax(runs))
    before, after = max(rest.rows - 1, row - 1), min(len(off) - 1, row + THRESHOLDS.in_a_row - 1)
    spread = abs(float(recording.command_pa[after] - recording.command_pa[before]))
    return Breakout(row, float(recording.time_s[row]), float(recording.command_pa[row]), spread, int(side[row]))


def farthest(recording: Recording, rest: Rest) -> Figure:
    """Return the farthest that the stem went from its rest by the median of a few samples, m."""
    x = recording.position_m
    if len(x) < THRESHOLDS.counted:
        return no_value("too few samples")
    windows = np.lib.stride_tricks.sliding_window_view(x, THRESHOLDS.counted)
    gone = np.abs(np.median(windows, axis=1) - rest.position_m)
    return Figure(float(np.max(gone)), 2.0 * 1.25 * rest.noise_m / sqrt(THRESHOLDS.counted))


def _rest(recording: Recording, first: int, last: int) -> Rest | None:
    x, t = recording.position_m[first:last], recording.time_s[first:last]
    if len(x) < THRESHOLDS.fewest_at_rest:
        return None
    creep, scatter = rate_of(t, x)
    digit_m = quantum_m(recording.position_m)
    noise = max(scatter, digit_m / sqrt(12.0))
    return Rest(float(np.mean(x)), noise, (creep.value or 0.0) * float(t[-1] - t[0]), digit_m, last - first)

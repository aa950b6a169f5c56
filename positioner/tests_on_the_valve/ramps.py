"""Slow ramps of the command up and down: where the stem follows in a straight line, and where it lies at its ends.

A leg is a stretch in which the command goes one way over most of what it spans. On it the stem rests at an end,
follows, and rests at the other:

    x(p) = g p + h                      by least squares, p between the commands at which x is 10 and 90 % of the travel
    cov = (M'M)^-1 (sum_|l|<L (1 - |l|/L) sum_i e_i e_(i+l) m_i m_(i+l)') (M'M)^-1      rows m_i = (p_i, 1), residuals e

Rows are chosen by the command, which has no noise: chosen by the noisy position, the line would be bent. Residuals of a
stem that sticks and slips hang together, so neighbours count, L = 1.5 n^(1/3). Where the slopes g of all legs agree
within three deviations they are one: the spring's. Friction that goes over the travel turns them apart.

At a rate r of the command the line is late by what lags, in proportion to r. Lines at two rates tell the pressure at
none, by weighted least squares:

    p_s(x, r) = p_s(x) + t_s r          s = +1 up, -1 down

Where the stem sticks and slips, its line is between those of sliding and of static friction: by how much its scatter
tells (`Line.slip_pa`), and each figure is known no better.

p command, Pa; x position, m; r rate, Pa/s.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import hypot, sqrt

import numpy as np
from numpy.typing import NDArray

from config.recording import Column, Recording
from positioner.response.figure import Figure, no_value
from positioner.tests_on_the_valve.valve_test_thresholds import THRESHOLDS
from signals.noise import quantum_m


@dataclass(frozen=True, slots=True)
class Leg:
    """A stretch of one way, (n,) each: s, Pa, m; `rate` in Pa/s, positive."""

    way: int
    rate_pa_per_s: float
    time_s: Column
    command_pa: Column
    position_m: Column


@dataclass(frozen=True, slots=True)
class Line:
    """x = slope p + level of one leg with its covariance, and what was left, m."""

    leg: Leg
    slope: float
    level: float
    covariance: tuple[tuple[float, float], tuple[float, float]]
    residual_m: float

    def pressure_pa(self, position_m: float) -> tuple[float, float]:
        """Return the command at which the line passes a position, Pa, and its standard deviation."""
        pressure_pa = (position_m - self.level) / self.slope
        (pp, pl), (_, ll) = self.covariance
        variance = pressure_pa**2 * pp + 2.0 * pressure_pa * pl + ll
        return pressure_pa, sqrt(max(variance, 0.0)) / abs(self.slope)

    def of_slope(self, slope: float, variance: float) -> "Line":
        """Return the line of another slope, m/Pa, through the middle of this one, where its level is known best."""
        (pp, pl), (_, ll) = self.covariance
        middle_pa = -pl / pp if pp else 0.0
        level = self.level + (self.slope - slope) * middle_pa
        both = -middle_pa * variance
        covariance = (variance, both), (both, ll + middle_pa * (pl - both))
        return replace(self, slope=slope, level=level, covariance=covariance)

    @property
    def held_pa(self) -> float:
        """How far the command goes from sample to sample, Pa: it is known no better between them."""
        return self.leg.rate_pa_per_s * float(np.median(np.diff(self.leg.time_s)))

    @property
    def slip_pa(self) -> float:
        """How far a stem that sticks and slips lies behind where it would slide, in the mean, Pa.

        A sawtooth of height A scatters by A / sqrt(12) beyond the noise, and its mean is A / 2 off its tips. The noise
        is what neighbours differ by.
        """
        steps_m = np.diff(self.leg.position_m)
        by_chance = 1.0 + THRESHOLDS.scatter_by_chance / sqrt(len(steps_m))
        return sqrt(3.0 * max(self.residual_m**2 - 0.5 * by_chance * float(np.var(steps_m)), 0.0)) / self.slope

    @property
    def slope_std(self) -> float:
        """Standard deviation of the slope, m/Pa."""
        return sqrt(self.covariance[0][0])


@dataclass(frozen=True, slots=True)
class Ramps:
    """What the legs of a record show together.

    Attributes:
        lines: of each leg with one.
        slope_pa_per_m: spring rate over the area.
        low_m, high_m: where the stem lies at the ends, undetermined where it was not seen to.
        noise_m: standard deviation of the position about its lines and ends.
    """

    lines: tuple[Line, ...]
    slope_pa_per_m: Figure
    low_m: Figure
    high_m: Figure
    noise_m: float

    def at_no_rate(self, way: int, position_m: float) -> Figure:
        """Return the command at which the stem passes a position in one direction, without lag, Pa."""
        lines = [each for each in self.lines if each.leg.way == way]
        rates = [each.leg.rate_pa_per_s for each in lines]
        if lines and max(rates) - min(rates) < THRESHOLDS.same_rate * max(rates):
            return no_value("ramps of one rate alone: lag would count as friction")
        return self._at(way, position_m, lines, np.column_stack([np.ones(len(rates)), rates]))

    def at_slowest(self, way: int, position_m: float) -> Figure:
        """Return the same at the slowest rate that was played, lag and all, Pa."""
        lines = self.slowest(way)
        return self._at(way, position_m, lines, np.ones((len(lines), 1)))

    def _at(self, way: int, position_m: float, lines: Sequence[Line], matrix: Column) -> Figure:
        """Return the first coefficient, by weighted least squares, of the commands at which lines pass a position."""
        if not lines:
            return no_value(f"no ramp {'up' if way > 0 else 'down'} has moved the stem along a line")
        pressures, deviations = np.array([each.pressure_pa(position_m) for each in lines]).T
        weights = 1.0 / np.hypot(deviations, [THRESHOLDS.held * each.held_pa for each in lines])
        solved = np.linalg.lstsq(matrix * weights[:, None], pressures * weights)[0]
        covariance = np.linalg.inv((matrix * weights[:, None] ** 2).T @ matrix)
        return Figure(float(solved[0]), THRESHOLDS.sigmas * hypot(sqrt(float(covariance[0, 0])), self._slip_pa(way)))

    @property
    def rates_pa_per_s(self) -> tuple[float, ...]:
        """The rates that were played, slowest first, like ones once."""
        told: list[float] = []
        for rate in sorted(each.leg.rate_pa_per_s for each in self.lines):
            if not told or rate > (1.0 + THRESHOLDS.same_rate) * told[-1]:
                told.append(rate)
        return tuple(told)

    def slowest(self, way: int) -> list[Line]:
        """Return the lines of one direction at the slowest rate."""
        lines = [each for each in self.lines if each.leg.way == way]
        if not lines:
            return []
        limit = (1.0 + THRESHOLDS.same_rate) * min(each.leg.rate_pa_per_s for each in lines)
        return [each for each in lines if each.leg.rate_pa_per_s < limit]

    def _slip_pa(self, way: int) -> float:
        """Return by how much the lines of one direction are off for slips, Pa: all of them the same way."""
        return float(np.median([each.slip_pa for each in self.lines if each.leg.way == way]))


def difference(one: Figure, other: Figure, share: float = 1.0) -> Figure:
    """Return a share of one less the other, or why there is none."""
    if one.value is None or other.value is None:
        return one if one.value is None else other
    return Figure(share * (one.value - other.value), abs(share) * hypot(one.plus_minus or 0.0, other.plus_minus or 0.0))


def scaled(figure: Figure, by: float) -> Figure:
    """Return a figure times a number, or why there is none."""
    return difference(figure, Figure(0.0, 0.0), by)


def rate_of(time_s: Column, x: Column) -> tuple[Figure, float]:
    """Return how fast something changes, by its best line, and the standard deviation of what is left."""
    at_s = time_s - time_s[0]
    slope, level = np.polyfit(at_s, x, 1)
    left = float(np.std(x - slope * at_s - level, ddof=2))
    return Figure(float(slope), THRESHOLDS.sigmas * left / (float(np.std(at_s)) * sqrt(len(x)))), left


def legs_of(recording: Recording) -> list[Leg]:
    """Return the legs of a recording; rows without a position or a command are left out."""
    whole = np.isfinite(recording.position_m) & np.isfinite(recording.command_pa)
    time_s, command_pa = recording.time_s[whole], recording.command_pa[whole]
    position_m = recording.position_m[whole]
    if len(time_s) < THRESHOLDS.fewest_moving:
        return []
    span_pa = float(np.ptp(command_pa))
    found = []
    for first, last in _one_way(command_pa, 1e-3 * span_pa):
        risen_pa = float(command_pa[last] - command_pa[first])
        if abs(risen_pa) < THRESHOLDS.leg_span * span_pa or span_pa == 0.0:
            continue
        rows = slice(first, last + 1)
        rate = abs(risen_pa) / float(time_s[last] - time_s[first])
        found.append(Leg(1 if risen_pa > 0 else -1, rate, time_s[rows], command_pa[rows], position_m[rows]))
    return found


def ramps_of(legs: Sequence[Leg]) -> Ramps:
    """Return lines, ends and noise of legs; without a leg that moves the stem there is no line."""
    lines = [line for leg in legs if (line := _line(leg)) is not None]
    lows, highs, scatter = [], [], []
    for line in lines:
        low, high = _at_ends(line)
        lows.append(low)
        highs.append(high)
        scatter.append(line.residual_m)
    digit_m = quantum_m(np.concatenate([leg.position_m for leg in legs])) if legs else 0.0
    slope_pa_per_m = _slope_pa_per_m(lines)
    return Ramps(
        _parallel(lines, slope_pa_per_m),
        slope_pa_per_m,
        _end(lows, "the lower", digit_m),
        _end(highs, "the upper", digit_m),
        float(np.median(scatter)) if scatter else 0.0,
    )


def _slope_pa_per_m(lines: Sequence[Line]) -> Figure:
    """Return the spring rate over the area, Pa/m: mean of all lines, which lag does not turn."""
    if not lines:
        return no_value("no ramp has a line")
    slopes = np.array([1.0 / each.slope for each in lines])
    deviations = np.array([each.slope_std / each.slope**2 for each in lines])
    weights = 1.0 / np.maximum(deviations, 1e-12 * np.abs(slopes)) ** 2
    mean = float(np.sum(weights * slopes) / np.sum(weights))
    own = 1.0 / sqrt(float(np.sum(weights)))
    spread = float(np.sqrt(np.sum(weights * (slopes - mean) ** 2) / np.sum(weights) / max(1, len(slopes) - 1)))
    return Figure(mean, THRESHOLDS.sigmas * max(own, spread))


def _parallel(lines: Sequence[Line], slope_pa_per_m: Figure) -> tuple[Line, ...]:
    """Return lines of one slope, each through its own middle, where the slopes agree; else as they are."""
    if not slope_pa_per_m.value:
        return tuple(lines)
    slope = 1.0 / slope_pa_per_m.value
    std = slope**2 * (slope_pa_per_m.plus_minus or 0.0) / THRESHOLDS.sigmas
    agree = all(abs(each.slope - slope) <= THRESHOLDS.parallel_sigmas * each.slope_std for each in lines)
    return tuple(each.of_slope(slope, std**2) for each in lines) if agree else tuple(lines)


def _one_way(command: Column, tolerance: float) -> list[tuple[int, int]]:
    """Return first and last row of the stretches in which a command goes one way, holds left out at their ends."""
    found: list[tuple[int, int]] = []
    first = extreme = 0
    way = 0
    for row in range(1, len(command)):
        gone = command[row] - command[extreme]
        if way == 0 and abs(command[row] - command[first]) > tolerance:
            way, extreme = (1 if command[row] > command[first] else -1), row
        elif way * gone > 0:
            extreme = row
        elif way and way * gone < -tolerance:
            found.append((_begin(command, first, way), extreme))
            first, extreme, way = extreme, row, -way
    if way:
        found.append((_begin(command, first, way), extreme))
    return found


def _begin(command: Column, first: int, way: int) -> int:
    """Return the last row before a command that was held goes off."""
    row = first
    while row + 1 < len(command) and way * (command[row + 1] - command[first]) <= 0:
        row += 1
    return row


def _line(leg: Leg) -> Line | None:
    levels = [
        float(np.mean(each)) for each in np.array_split(leg.position_m, min(THRESHOLDS.bins, len(leg.position_m)))
    ]
    low, high = min(levels), max(levels)
    noise = float(np.std(np.diff(leg.position_m))) / sqrt(2.0)
    per_bin = len(leg.position_m) / len(levels)
    if high - low < THRESHOLDS.moved_sigmas * noise / sqrt(per_bin) + 1e-12 or (
        levels[-1] - levels[0]
    ) * leg.way <= 0.5 * (high - low):
        return None
    inner = (low + THRESHOLDS.inner[0] * (high - low), low + THRESHOLDS.inner[1] * (high - low))
    pressures = np.array([float(np.mean(each)) for each in np.array_split(leg.command_pa, len(levels))])
    order = np.argsort(pressures)
    at = [float(np.interp(each, np.maximum.accumulate(np.array(levels)[order]), pressures[order])) for each in inner]
    found: Line | None = None
    for _ in range(THRESHOLDS.passes):
        rows = (leg.command_pa >= at[0]) & (leg.command_pa <= at[1])
        if int(rows.sum()) < THRESHOLDS.fewest_moving:
            return found
        found = _fitted(leg, rows)
        if found is None:
            return None
        low, high = _levels(found, low, high)
        at = [found.pressure_pa(low + share * (high - low))[0] for share in THRESHOLDS.inner]
    return found


def _fitted(leg: Leg, rows: NDArray[np.bool_]) -> Line | None:
    p, x = leg.command_pa[rows], leg.position_m[rows]
    middle = float(np.mean(p))
    matrix = np.column_stack([p - middle, np.ones(len(p))])
    solved = np.linalg.lstsq(matrix, x)[0]
    e = x - matrix @ solved
    slope = float(solved[0])
    if slope <= 0.0:
        return None
    bread = np.linalg.inv(matrix.T @ matrix)
    scored = matrix * e[:, None]
    filling = scored.T @ scored
    lags = max(1, min(len(p) // 4, int(1.5 * len(p) ** (1.0 / 3.0))))
    for lag in range(1, lags):
        both = scored[lag:].T @ scored[:-lag]
        filling = filling + (1.0 - lag / lags) * (both + both.T)
    about = bread @ filling @ bread * len(p) / max(1, len(p) - 2)
    # From (p - middle, 1) to (p, 1): the level is h = c - g middle.
    turn = np.array([[1.0, 0.0], [-middle, 1.0]])
    (pp, pl), (lp, ll) = (turn @ about @ turn.T).tolist()
    residual = float(np.sqrt(np.sum(e**2) / max(1, len(p) - 2)))
    return Line(leg, slope, float(solved[1]) - slope * middle, ((pp, pl), (lp, ll)), residual)


def _levels(line: Line, low: float, high: float) -> tuple[float, float]:
    """Return where the stem lies at its ends by this leg; as guessed where it does not lie there."""
    ends = _at_ends(line, (low, high))
    told = [mean_m for mean_m, _, _ in ends]
    return (low if told[0] is None else told[0]), (high if told[1] is None else told[1])


End = tuple[float | None, float, int]
"""Of the end at which a leg arrives, for where it sets off friction holds the stem, stop or none: mean of the samples
there, m, or None; their scatter, m; how many."""


def _at_ends(line: Line, near: tuple[float, float] | None = None) -> tuple[End, End]:
    x, p = line.leg.position_m, line.leg.command_pa
    low, high = near or np.quantile(x, THRESHOLDS.end_quantiles).tolist()
    first, last = line.pressure_pa(low)[0], line.pressure_pa(high)[0]
    margin = THRESHOLDS.beyond * (last - first)
    found: list[End] = []
    for rows, guess, way in ((p < first - margin, low, -1), (p > last + margin, high, 1)):
        at = x[rows]
        if len(at) < THRESHOLDS.fewest_in_bin or way != line.leg.way:
            found.append((None, 0.0, 0))
        else:
            level = float(np.mean(at)) if near else float(np.median(at))
            agrees = abs(level - guess) < THRESHOLDS.end_agrees * (high - low)
            found.append((level if agrees else None, float(np.std(at)), len(at)))
    return found[0], found[1]


def _end(seen: Sequence[End], which: str, digit_m: float) -> Figure:
    told = [(level, scatter, count) for level, scatter, count in seen if level is not None]
    if not told:
        return no_value(f"the stem was not seen to lie at {which} end of its travel")
    counts = np.array([count for _, _, count in told], dtype=np.float64)
    levels = np.array([level for level, _, _ in told])
    middle = float(np.sum(counts * levels) / np.sum(counts))
    own = sqrt(sum(count * scatter**2 for _, scatter, count in told)) / float(np.sum(counts))
    spread = float(np.std(levels, ddof=1)) / sqrt(len(levels)) if len(levels) > 1 else 0.0
    # A stem at rest shows one digit, wherever in it that is.
    return Figure(middle, THRESHOLDS.sigmas * max(own, spread, digit_m / sqrt(12.0)))

"""Whether a command changed between the samples that show it: by where slides end, under a command that ramps.

    x_i = a + b (u_(i-1) + w d_i) + s_i (c + e z_i + h t_i) + f z_i^2 + g t_i    rows i to which the stem moved
    d_i = s_i max(0, s_i (u_i - u_(i-1)))                                  how much farther the command had gone by then

x position, m; s direction; u command, Pa; z that before, u_(i-1), less its mean, over its range; t time. A command that
is held from its sample to the next moves the stem to where it balances that one, u_(i-1), and knows nothing of the
next: w is 0, or below where the pressure lags behind. A command that went on meanwhile took the stem along, some part
of the way to the next one that is recorded: w is above 0. A controller that sees the stem goes back where that went too
far, so that its answer makes w smaller, never larger. The other terms are what springs, friction and areas that vary
leave over the stroke and in time, lest they be taken for w.

The line is fitted robustly (soft L1), w with its standard deviation. What friction does besides, as where it wanders,
is alike in all movements of one stroke, so that strokes are counted where that tells less. Where the line leaves both
open nobody knows which it was, as where movements are few, or the same again and again: then its deviation is infinite.
"""

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from workbench.data.record import Record

MOVED = 6.0
"""Noises by which a stem moves from one sample to the next."""
GOES_ON = 0.2
"""Share of the movements with which the command goes on, where it ramps: with fewer it is held, unless they tell."""
FEWEST_MOVES, FEWEST_AHEAD = 20, 10
"""Of movements, and of those with which the command goes on: eight numbers are fitted."""
DEVIATIONS, LEAST_PART = 3.0, 0.05
"""By so many standard deviations w must be more than this, for the command to have changed between samples."""
HELD_DEVIATIONS, HELD_PART = 2.0, 0.3
"""And less than this, for it to have been held."""
LEAST_ALONE = 0.3
"""Part of d that the other terms must not imitate: a few movements, again and again, tell no eight numbers."""
LINEAR_FROM = 2.0
"""Robust deviations from which an error counts by its size, not by its square."""
ROUNDS = 30
NORMAL_MAD = 1.4826
"""Standard deviations in a median absolute one."""


class PartOfTheWay(NamedTuple):
    """w: how far the command had gone to the next one that is recorded when it moved the stem."""

    part: float
    std: float
    moves: int

    @property
    def between(self) -> bool:
        """Whether the command changed between samples, beyond doubt."""
        return self.part - DEVIATIONS * self.std > LEAST_PART

    @property
    def held(self) -> bool:
        """Whether it did not, beyond doubt."""
        return self.part + HELD_DEVIATIONS * self.std < HELD_PART


def part_of_the_way(record: Record) -> PartOfTheWay | None:
    """Return w of a record; None where the command stands still as the stem moves, so that it was held."""
    rows, way = _moved_to(record)
    u = record.command_pa
    before_pa: Column = u[rows - 1]
    ahead_pa: Column = way * np.maximum(way * (u[rows] - before_pa), 0.0)
    ahead_count = int(np.count_nonzero(ahead_pa))
    untold = PartOfTheWay(0.0, inf, rows.size) if ahead_count > GOES_ON * rows.size else None
    if rows.size < FEWEST_MOVES or ahead_count < FEWEST_AHEAD:
        return untold
    span_pa, span_s = float(np.ptp(u)), float(np.ptp(record.time_s))
    z = (before_pa - float(np.mean(u))) / span_pa
    t = (record.time_s[rows] - record.time_s[0]) / span_s
    b, ahead = 0, 1
    matrix = np.column_stack([z, ahead_pa / span_pa, np.ones(rows.size), way, way * z, way * t, z**2, t])
    if _left_alone(matrix, ahead) < LEAST_ALONE:
        return untold
    strokes = np.cumsum(np.diff(way, prepend=way[0]) != 0.0)
    found, variances = _robust_line(matrix, record.position_m[rows], record.scale_m, strokes)
    if not found[b] > 0.0:
        return untold
    return PartOfTheWay(float(found[ahead] / found[b]), float(variances[ahead] ** 0.5 / found[b]), rows.size)


def _moved_to(record: Record) -> tuple[NDArray[np.int64], Column]:
    """Return the rows to which the stem moved in their sample, (moves,), and which way, +-1."""
    found = []
    for first, end in record.segments:
        moved_m = np.diff(np.where(record.valid, record.position_m, np.nan)[first:end])
        found.append(first + 1 + np.flatnonzero(np.abs(moved_m) > MOVED * record.scale_m))
    rows = np.concatenate(found) if found else np.empty(0, np.int64)
    return rows, np.sign(record.position_m[rows] - record.position_m[rows - 1])


def _left_alone(matrix: NDArray[np.float64], column: int) -> float:
    """Return the part of a column that no combination of the others gives, 0 to 1."""
    one, others = matrix[:, column], np.delete(matrix, column, axis=1)
    left = one - others @ np.linalg.lstsq(others, one)[0]
    return float(np.linalg.norm(left) / np.linalg.norm(one))


def _robust_line(
    matrix: NDArray[np.float64], y: Column, least: float, strokes: NDArray[np.int64]
) -> tuple[Column, Column]:
    """Return the coefficients of a robust line and their variances; errors below `least` are none.

    Of errors that are independent, or that hang together in each of the strokes, the larger ones.
    """
    weights = np.ones(y.size)
    for _ in range(ROUNDS):
        weighted = matrix * weights[:, None]
        found = np.linalg.lstsq(weighted, y * weights)[0]
        errors = y - matrix @ found
        scale = max(LINEAR_FROM * NORMAL_MAD * float(np.median(np.abs(errors))), least) or 1.0
        weights = (1.0 + (errors / scale) ** 2) ** -0.25
    inverse = np.linalg.pinv(weighted.T @ weighted)
    alone = float(np.sum((weights * errors) ** 2)) / max(y.size - matrix.shape[1], 1) * np.diag(inverse)
    pulls = np.zeros((int(strokes[-1]) + 1, matrix.shape[1]))
    np.add.at(pulls, strokes, weighted * (weights * errors)[:, None])
    together = np.sum((pulls @ inverse) ** 2, axis=0)
    return np.asarray(found), np.maximum(alone, together)

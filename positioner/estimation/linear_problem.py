"""The linear least-squares problem at fixed (ln τ, ln μ), and the sensitivities of its residuals.

For given p = (ln τ, ln μ, starts) the model y_i = g X_g + q X_q + x_0 X_0 + v_0 X_1 (`stem_response`) is linear in g, q
and in every motion's beginning. The columns of all motions stand in one matrix, g and q shared; a prior is four more
rows; what may act beside the model is one more column, shared by all. A force of one direction shifts the rest that the
stem is drawn to; a sensor that drifts shifts what is shown, and by what it had drifted when a motion began, the rest:

    preload   σ X_q
    drift     (t - t_b) + (t_b - t_0) σ X_q      t_b where a motion begins, t_0 where the first does; σ X_q = 1 - X_0

The derivatives by p are differences.
"""

from dataclasses import dataclass
from math import exp

import numpy as np

from positioner.estimation.array import Array
from positioner.estimation.motion_preparation import Beside, PreparedMotion
from positioner.estimation.stem_response import responses

DEGENERATE = 1e-8
"""Share of the largest singular value below which a direction is unknown, as g and q are apart after a single jump: of
all that explain the motion equally well the smallest is taken, whose g and q share it."""
DIFFERENCE = 1e-6
"""Step of the differences by p."""


@dataclass(frozen=True, slots=True)
class Prior:
    """What is known beforehand of (ln τ, ln μ, g, q): mean (4,), root R (4, 4) of the information R'R / σ_x^2.

    R may be singular: what it does not know, it does not pull at.
    """

    mean: Array
    root: Array


@dataclass(frozen=True, slots=True)
class LinearProblem:
    """The linear problem at some p, R rows and C columns.

    Attributes:
        columns: (R, C), of g, q and the beginnings; the rows of the motions, of their starts and of the prior.
        measured: (R,), what the columns should give, m times the root of each row's samples.
        scale: (C,), norms of the columns.
    """

    columns: Array
    measured: Array
    scale: Array

    def solved(self) -> tuple[Array, float]:
        """Return the most likely linear parameters (C,), g in m/Pa, q in m and the beginnings, and S in m^2."""
        whole = np.column_stack((self.columns / self.scale, self.measured))
        R: Array = np.asarray(np.linalg.qr(whole, mode="r"))
        found = np.linalg.lstsq(R[:-1, :-1], R[:-1, -1], rcond=DEGENERATE)[0]
        left = R[:, -1] - R[:, :-1] @ found
        return found / self.scale, float(left @ left)


def linear_problem(motions: list[PreparedMotion], p: Array, prior: Prior | None) -> LinearProblem:
    """Return the linear problem at p, (2 + starts,): ln τ and ln μ in s and s^2, shares of the start intervals."""
    blocks = [_columns(each, p) for each in started(motions, p)]
    starts = [each.start_interval for each in motions if each.start_interval is not None]
    rows = sum(len(each) for each in blocks) + len(starts) + (4 if prior is not None else 0)
    beside = motions[0].beside
    columns: Array = np.zeros((rows, 2 + sum(each.shape[1] - 2 for each in blocks) + (beside is not Beside.NOTHING)))
    measured: Array = np.zeros(rows)
    row, column = 0, 2
    for motion, block in zip(motions, blocks, strict=True):
        height, width = len(block), block.shape[1]
        columns[row : row + height, :2] = block[..., :2]
        columns[row : row + height, column : column + width - 2] = block[..., 2:]
        if beside is not Beside.NOTHING:
            columns[row : row + height, -1] = motion.direction * block[..., 1]
        if beside is Beside.DRIFT:
            begun_s = motion.time_s[0]
            columns[row : row + height, -1] *= begun_s - motions[0].time_s[0]
            columns[row : row + height - 1, -1] += (motion.time_s[1:] - begun_s) * motion.weight
        measured[row : row + height] = _measured_rows(motion)
        row, column = row + height, column + width - 2
    for start, share in zip(starts, p[2:].tolist(), strict=True):
        measured[row] = start.weight * (start.expected - share)
        row += 1
    if prior is not None:
        columns[row:, :2] = prior.root[:, 2:]
        measured[row:] = prior.root @ prior.mean - prior.root[:, :2] @ p[:2]
    scale = np.sqrt((columns**2).sum(axis=0))
    return LinearProblem(columns, measured, np.where(scale > 0, scale, 1.0))


def sensitivities(
    motions: list[PreparedMotion], p: Array, problem: LinearProblem, linear: Array, prior: Prior | None
) -> Array:
    """Return [scaled columns, derivatives of the model by p, residuals] (R, C + len(p) + 1), a row per sample.

    Args:
        motions: that the problem was made of.
        p: at which it was made.
        problem: that of `linear_problem`.
        linear: (C,), its solution.
        prior: as there.
    """
    modelled = problem.columns @ linear - problem.measured
    slopes = np.empty((len(modelled), len(p)))
    for number in range(len(p)):
        moved = p.copy()
        moved[number] += DIFFERENCE
        near = linear_problem(motions, moved, prior)
        slopes[:, number] = (near.columns @ linear - near.measured - modelled) / DIFFERENCE
    return np.column_stack((problem.columns / problem.scale, slopes, -modelled))


def started(motions: list[PreparedMotion], p: Array) -> list[PreparedMotion]:
    """Return the motions, each with a start interval begun at its share of it, p[2:] of p, (2 + starts,)."""
    shares = iter(p[2:].tolist())
    return [each if each.start_interval is None else each.start_interval.begin(each, next(shares)) for each in motions]


def _columns(motion: PreparedMotion, p: Array) -> Array:
    """Return X_g, X_q, X_0 and, if free, X_1 (N + 1, 3 or 4), weighted; the last row is the rest's."""
    X_g, X_q, X_0, X_1 = responses(
        motion.time_s, motion.pressure_pa, motion.direction, exp(p[0]), exp(p[1]), held=motion.held
    )
    free = (X_g, X_q, X_0, X_1) if motion.free_velocity else (X_g, X_q, X_0)
    rows: Array = np.zeros((len(motion.position_m) + 1, len(free)))
    for number, column in enumerate(free):
        rows[:-1, number] = column[1:] * motion.weight
    rows[-1, 2] = motion.rest_count**0.5
    return rows


def _measured_rows(motion: PreparedMotion) -> Array:
    return np.append(motion.position_m * motion.weight, motion.rest_m * motion.rest_count**0.5)

"""How much of a residual hangs on the state: a meter of what is unexplained. It never names a cause.

    e ~ (x, v, d, u, du/dt, t), their squares and products;   d direction of the last motion
    R^2 = (sum (e - mean)^2 - sum (e - e_hat)^2) / sum ((e - mean)^2 + n^2)
                                                     e_hat from ridge regression on the other four fifths, n negligible

The fifths are whole stretches of time. The residual is clipped at 5 of its robust deviations, so that one missed slip
is not the whole of it. On noise R^2 is 0 or less.
"""

from itertools import combinations_with_replacement

import numpy as np
import numpy.typing as npt

from config.recording import Column
from workbench.data.motion import directions, velocity_m_per_s
from workbench.data.record import Record

FOLDS = 5
RIDGE = 0.03
"""Of the number of samples; the regressors have variance 1."""
STRUCTURED = 0.1
"""R^2 above which the residual is not the noise's."""
CLIPPED = 5.0
FEWEST = 100

Matrix = npt.NDArray[np.float64]


def structure(record: Record, residual_m: Column, negligible_m: float = 0.0) -> float:
    """Return the cross-validated R^2 of a residual, m, (n,), NaN where it does not count; 0 of under 100 samples.

    What is far below the negligible, m, has none: of a recording without noise what is left is the arithmetic's.
    """
    rows = np.flatnonzero(np.isfinite(residual_m))
    if rows.size < FEWEST:
        return 0.0
    matrix = _regressors(record)[rows]
    error = clipped(residual_m[rows])
    fold = np.arange(rows.size) * FOLDS // rows.size
    left = np.empty(rows.size)
    spread = np.empty(rows.size)
    for k in range(FOLDS):
        here, others = fold == k, fold != k
        mean = error[others].mean()
        left[here] = error[here] - mean - matrix[here] @ _ridge(matrix[others], error[others] - mean)
        spread[here] = error[here] - mean
    total = float(np.sum(spread**2)) + rows.size * negligible_m**2
    return float(np.sum(spread**2) - np.sum(left**2)) / total if total > 0.0 else 0.0


def clipped(error_m: Column) -> Column:
    """Return the error, m, (n,), about its median, clipped at 5 of its robust deviations; NaN stays."""
    middle = float(np.nanmedian(error_m))
    deviation = 1.4826 * float(np.nanmedian(np.abs(error_m - middle)))
    return np.clip(error_m - middle, -CLIPPED * deviation, CLIPPED * deviation)


def _ridge(matrix: Matrix, error: Column) -> Column:
    n, k = matrix.shape
    return np.asarray(np.linalg.solve(matrix.T @ matrix + RIDGE * n * np.eye(k), matrix.T @ error))


def _regressors(record: Record) -> Matrix:
    """Return the standardised state and its products, (n, 27)."""
    state = np.zeros((len(record), 6))
    for first, end in record.segments:
        rows = slice(first, end)
        position_m = np.where(record.valid, record.position_m, np.nan)[rows]
        time_s = record.time_s[rows]
        way = directions(position_m, record.scale_m)
        last = np.maximum.accumulate(np.where(way != 0, np.arange(way.size), 0))
        velocity = velocity_m_per_s(time_s, position_m)
        change = np.gradient(record.command_pa[rows], time_s)
        state[rows] = np.column_stack([position_m, velocity, way[last], record.command_pa[rows], change, time_s])
    state = _standard(np.nan_to_num(state))
    products = [state[:, i] * state[:, j] for i, j in combinations_with_replacement(range(6), 2)]
    return _standard(np.column_stack([state, *products]))


def _standard(matrix: Matrix) -> Matrix:
    spread = matrix.std(axis=0)
    return np.asarray((matrix - matrix.mean(axis=0)) / np.where(spread > 0.0, spread, 1.0))

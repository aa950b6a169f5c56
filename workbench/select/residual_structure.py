"""How much of a residual hangs on the state: a meter of what is unexplained. It never names a cause.

    e ~ (x, v, d, u, du/dt, t), their squares and products;   d direction of the last motion
    R^2 = (sum (e - mean)^2 - sum (e - e_hat)^2) / sum ((e - mean)^2 + n^2)
                                                     e_hat from ridge regression on the other four fifths, n negligible

R^2 counts where it is no chance: -n' log(1 - R^2), its evidence, is enough; n' the number of independent samples.
The fifths are whole stretches of time. The residual is clipped at 5 of its robust deviations, so that one missed slip
is not the whole of it. On noise R^2 is 0 or less.
"""

from functools import lru_cache
from itertools import combinations_with_replacement, pairwise

import numpy as np
import numpy.typing as npt

from config.recording import Column
from signals.independence import CLIPPED, DEVIATION, independent_share
from signals.moves import directions
from workbench.data.motion import velocity_m_per_s
from workbench.data.record import Record
from workbench.select.selection_thresholds import SELECTION

Matrix = npt.NDArray[np.float64]


def structure(record: Record, residual_m: Column, negligible_m: float = 0.0) -> float:
    """Return the cross-validated R^2 of a residual, m, (n,), NaN where it does not count; 0 of under 100 samples.

    What is far below the negligible, m, has none: of a recording without noise what is left is the arithmetic's.
    """
    rows = np.flatnonzero(np.isfinite(residual_m))
    if rows.size < SELECTION.fewest_rows:
        return 0.0
    matrix, error = _regressors(record, rows), clipped(residual_m[rows])
    ends = [-(-k * rows.size // SELECTION.folds) for k in range(SELECTION.folds + 1)]
    fifths = [slice(*each) for each in pairwise(ends)]
    # Sums over a fifth, taken from those over all, are the sums over the others: nothing is copied.
    squares = [matrix[each].T @ matrix[each] for each in fifths]
    products = [matrix[each].T @ error[each] for each in fifths]
    sums = [matrix[each].sum(axis=0) for each in fifths]
    all_squares, all_products, all_sums = sum(squares), sum(products), sum(sums)
    left = np.empty(rows.size)
    spread = np.empty(rows.size)
    for k, here in enumerate(fifths):
        n = rows.size - (here.stop - here.start)
        mean = (error.sum() - error[here].sum()) / n
        onto = all_products - products[k] - mean * (all_sums - sums[k])
        slopes = np.linalg.solve(all_squares - squares[k] + SELECTION.ridge * n * np.eye(len(onto)), onto)
        spread[here] = error[here] - mean
        left[here] = spread[here] - matrix[here] @ slopes
    total = float(np.sum(spread**2)) + rows.size * negligible_m**2
    found = float(np.sum(spread**2) - np.sum(left**2)) / total if total > 0.0 else 0.0
    independent = rows.size * independent_share(error)
    return found if -independent * np.log1p(-found) > SELECTION.least_evidence else min(found, 0.0)


def clipped(error_m: Column) -> Column:
    """Return the error, m, (n,), about its median, clipped at 5 of its robust deviations; NaN stays."""
    middle = float(np.nanmedian(error_m))
    deviation = DEVIATION * float(np.nanmedian(np.abs(error_m - middle)))
    return np.clip(error_m - middle, -CLIPPED * deviation, CLIPPED * deviation)


def _regressors(record: Record, rows: npt.NDArray[np.intp]) -> Matrix:
    """Return the standardised state and its products at some rows of a record, (rows, 27), made one after another."""
    state = _state(record)
    pairs = list(combinations_with_replacement(range(state.shape[1]), 2))
    found = np.empty((rows.size, state.shape[1] + len(pairs)), order="F")
    found[:, : state.shape[1]] = state[rows]
    for column, (i, j) in enumerate(pairs, start=state.shape[1]):
        found[:, column] = _standard(state[:, i] * state[:, j])[rows]
    return found


@lru_cache(maxsize=4)  # of what was fitted and what was held out, in two diagnoses
def _state(record: Record) -> Matrix:
    """Return the standardised state, (n, 6): the record's own, for every model held against it."""
    state = np.zeros((len(record), 6), order="F")
    for first, end in record.segments:
        part = slice(first, end)
        position_m = np.where(record.valid, record.position_m, np.nan)[part]
        time_s = record.time_s[part]
        way = directions(position_m, record.scale_m)
        last = np.maximum.accumulate(np.where(way != 0, np.arange(way.size), 0))
        velocity = velocity_m_per_s(time_s, position_m)
        change = np.gradient(record.command_pa[part], time_s)
        state[part] = np.column_stack([position_m, velocity, way[last], record.command_pa[part], change, time_s])
    for column in range(state.shape[1]):
        state[:, column] = _standard(np.nan_to_num(state[:, column]))
    state.setflags(write=False)
    return state


def _standard(column: Column) -> Column:
    spread = float(column.std())
    return np.asarray((column - column.mean()) / (spread if spread > 0.0 else 1.0))

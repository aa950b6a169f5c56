"""Figures of an error: fit percentage, rms, and a robust one that a single missed slip does not carry.

fit = 100 (1 - ||y - x|| / ||y - mean y||)         as MATLAB's `compare`: x simulated, y measured position, not the same
                                                   throughout
robust = median over 1 s blocks of the block's rms
"""

import numpy as np

from config.recording import Column
from workbench.data.record import Record

BLOCK_S = 1.0


def valid_rows(record: Record, simulated_m: Column) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Return which rows count, (n,): valid in the record, and simulated, m, (n,) with NaN where not."""
    return record.valid & np.isfinite(simulated_m)


def fit_percent(record: Record, simulated_m: Column) -> float:
    """Return 100 (1 - ||y - y_hat|| / ||y - mean y||), Ljung's fit, of simulated positions, m, (n,)."""
    rows = valid_rows(record, simulated_m)
    measured_m = record.position_m[rows]
    if not np.ptp(measured_m) > 0.0:
        return -np.inf
    error = float(np.linalg.norm(simulated_m[rows] - measured_m))
    return 100.0 * (1.0 - error / float(np.linalg.norm(measured_m - measured_m.mean())))


def fit_in_words(percent: float, digits: int = 1) -> str:
    """Return a fit percentage in words; of a position that is the same throughout there is none."""
    return f"{percent:.{digits}f} %" if np.isfinite(percent) else "none"


def rms(values: Column) -> float:
    """Return the root of the mean square of (n,) values, in their unit; NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan


def robust(time_s: Column, values: Column) -> float:
    """Return the median of the rms over blocks of 1 s, in the values' unit; time, s, and values (n,)."""
    block = np.floor((time_s - time_s[0]) / BLOCK_S).astype(np.int64)
    _, member = np.unique(block, return_inverse=True)
    return float(np.median(np.sqrt(np.bincount(member, values**2) / np.bincount(member))))

"""The white noise of a sampled position, from its third differences in blocks, and the quantum it is rounded to.

The third difference of a smooth signal is small of third order in the step, that of white noise is not:

    d_k = x_k - 3 x_(k-1) + 3 x_(k-2) - x_(k-3),    var d = (1 + 9 + 9 + 1) σ^2 = 20 σ^2

A block of differences gives σ by one of two figures, and σ of a record is the median over its blocks, which takes no
note of the few that a jerk or an impact lies in:

    median of |d| / (0.6745 sqrt 20)    whatever a few samples of the block do; for blocks that a motion may begin in
    rms of d / sqrt 20                  less scatter from a short block; for blocks that are short and many

Everybody measures noise with these: the identification, running and from a record, and the workbench.
"""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

VARIANCE = 20.0
"""Of the third difference of white noise of variance 1."""
MEDIAN_OF_NORMAL = 0.6744897502
"""Median of |z|, z standard normal."""
FEWEST, MOST = 8, 64
"""Samples of a block that a record is cut into, a quarter of it in between."""


def noise_by_median(differences: Array) -> Array:
    """Return σ (...), in the unit of the position, by the median of the last axis of third differences (..., n)."""
    return np.asarray(np.median(np.abs(differences), axis=-1) / (MEDIAN_OF_NORMAL * VARIANCE**0.5))


def noise_by_rms(differences: Array) -> Array:
    """Return σ (...), in the unit of the position, by the rms over the last axis of third differences (..., n)."""
    return np.asarray(np.sqrt(np.mean(differences**2, axis=-1) / VARIANCE))


def white_noise_m(position_m: Array) -> float:
    """Return the standard deviation, m, of the white noise of N positions, (N,), finite and about evenly sampled.

    The median over blocks of `noise_by_median`; 0 for fewer than 8 samples. Rounding that hides the noise at rest shows
    once the stem moves.

    >>> rng = np.random.default_rng(0)
    >>> slow_motion_m = 0.05 + 0.01 * np.sin(np.linspace(0.0, 3.0, 4000))
    >>> f"{white_noise_m(slow_motion_m + rng.normal(0.0, 1e-5, 4000)):.0e}"
    '1e-05'
    """
    length = max(FEWEST, min(MOST, len(position_m) // 4))
    count = len(position_m) // length
    if not count:
        return 0.0
    blocks = np.diff(position_m[: count * length].reshape(count, length), 3, axis=1)
    return float(np.median(noise_by_median(blocks)))


def quantum_m(position_m: Array) -> float:
    """Return the step to which positions, (N,), m, are rounded, in m; 0 if they are not. NaN counts as missing.

    >>> f"{quantum_m(np.round(np.linspace(0.0, 0.01, 500) / 25e-6) * 25e-6):.3g}"
    '2.5e-05'
    """
    levels = np.unique(position_m[np.isfinite(position_m)])
    steps = np.diff(levels)
    if steps.size < 2:
        return float(steps[0]) if steps.size else 0.0
    # Levels a rounding error apart are one level.
    steps = steps[steps > 1e-9 * float(np.ptp(levels))]
    quantum = float(np.median(steps[steps < 1.5 * float(steps.min())]))
    small = steps[steps < 10.5 * quantum] / quantum
    on_grid = np.abs(small - np.round(small)) < 0.02
    return quantum if small.size > 0.1 * steps.size and on_grid.mean() > 0.95 else 0.0

"""The moment a noisy response crosses a level, and how sure it is.

A response y(t) that rises through a level L with noise of standard deviation σ passes it many times. Let t_a be the
last sample at or below L - 3σ before the first, t_b, at or above L + 3σ. Where few samples lie between them, hardly any
noise does: y is taken as straight between samples, and t_L is where the time spent below L ends,

    t_L = t_a + time in [t_a, t_b] with y < L        ± widest gap between samples in [t_a, t_b] / 2

Where many do, t_L is where a parabola through them, p(t) by least squares, is at L: it follows a response that bends,

    p(t_L) = L        ± σ sqrt(g' (M'M)^-1 g) / p'(t_L)        rows of M and g: 1, t, t^2 of the samples and of t_L
"""

from dataclasses import dataclass

import numpy as np

from config.recording import Column

FEWEST_PARABOLA_SAMPLES = 8
"""Samples between, from which the parabola is more certain than the gaps."""
CROSSING_SIGMA = 3.0
"""Half width, in standard deviations of the noise, of what counts as crossing a level."""


@dataclass(frozen=True, slots=True)
class LevelCrossing:
    """When a level was crossed, s; `gap_s` is the widest gap between the samples about the crossing."""

    time_s: float
    plus_minus_s: float
    gap_s: float


def level_crossing(time_s: Column, rising: Column, level: float, noise: float) -> LevelCrossing | None:
    """Return when a response, (n,), first rises through a level, time (n,) in s; None when it does not.

    Args:
        time_s: (n,), increasing.
        rising: (n,), the response in any unit.
        level: in that unit.
        noise: standard deviation of the response, in that unit.

    >>> t = np.linspace(0.0, 1.0, 11)
    >>> round(level_crossing(t, t, 0.632, 0.0).time_s, 3)
    0.632
    """
    above = rising >= level + CROSSING_SIGMA * noise
    if not above.any():
        return None
    end = int(above.argmax())
    below = np.flatnonzero(rising[:end] <= level - CROSSING_SIGMA * noise)
    start = int(below[-1]) if below.size else 0
    if start == end:
        return None
    t, y = time_s[start : end + 1], rising[start : end + 1]
    steps_s = np.diff(t)
    gap_s = float(steps_s.max())
    crossing_s = float(t[0] + np.sum(steps_s * _share_below(y, level)))
    fitted = _by_parabola(t[1:-1], y[1:-1], level, noise, crossing_s) if len(t) >= FEWEST_PARABOLA_SAMPLES + 2 else None
    crossing_s, plus_minus_s = fitted or (crossing_s, gap_s / 2)
    return LevelCrossing(crossing_s, plus_minus_s, gap_s)


def _by_parabola(t: Column, y: Column, level: float, noise: float, near_s: float) -> tuple[float, float] | None:
    """Return where the parabola rises through the level, s, and its uncertainty; None when it does not."""
    middle_s, half_s = (t[0] + t[-1]) / 2, (t[-1] - t[0]) / 2
    matrix = np.vander((t - middle_s) / half_s, 3)
    coefficients = np.linalg.lstsq(matrix, y)[0]
    a, b, c = coefficients.tolist()
    roots = np.roots([a, b, c - level])
    rising = [float(root.real) for root in roots if abs(root.imag) < 1e-9 and 2 * a * root.real + b > 0]
    if not rising:
        return None
    at = min(rising, key=lambda root: abs(root - (near_s - middle_s) / half_s))
    if abs(at) > 1:
        return None
    row = np.array([at * at, at, 1.0])
    spread = noise * float(np.sqrt(row @ np.linalg.solve(matrix.T @ matrix, row)))
    return middle_s + half_s * at, half_s * spread / (2 * a * at + b)


def _share_below(y: Column, level: float) -> Column:
    """Return which part of each straight piece between samples lies below the level."""
    low, high = np.minimum(y[:-1], y[1:]), np.maximum(y[:-1], y[1:])
    flat = high == low
    share = (level - low) / np.where(flat, 1.0, high - low)
    return np.where(flat, (low < level).astype(np.float64), np.clip(share, 0.0, 1.0))

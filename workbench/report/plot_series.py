"""Series made ready to be drawn: thinned out honestly, broken where the record is, rounded to what is seen.

A long series is drawn as the least and the greatest sample of each of many equal stretches, at their own times: no peak
and no spike is lost, and nothing is averaged.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from workbench.data.record import GAP_PERIOD_QUANTILES

MOST_SERIES_POINTS = 12_000
"""Points drawn of one series at most."""

Rows = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Drawn:
    """Points of a series, SI; NaN where the line is broken."""

    time_s: Column
    value: Column


def running_s(time_s: Column) -> Column:
    """Return the time since the start, s, (n,); where the clock is set back, time goes on by a period."""
    steps = np.diff(time_s)
    forward = steps[steps > 0.0]
    period_s = float(np.median(forward)) if forward.size else 0.0
    return np.concatenate([[0.0], np.cumsum(np.where(steps > 0.0, steps, period_s))])


def draw_series(time_s: Column, value: Column, most: int = MOST_SERIES_POINTS) -> Drawn:
    """Return a series, (n,), as it is drawn, broken where `workbench.data.record` breaks it; time, s, as recorded."""
    steps = np.diff(time_s)
    forward = steps[steps > 0.0]
    longest_s = GAP_PERIOD_QUANTILES * float(np.quantile(forward, 0.95)) if forward.size else np.inf
    breaks = np.flatnonzero((steps <= 0.0) | (steps > longest_s)) + 1
    along_s = running_s(time_s)
    time_s, value = np.insert(along_s, breaks, along_s[breaks]), np.insert(value, breaks, np.nan)
    rows = extremes(value, most)
    return Drawn(time_s[rows], value[rows])


def extremes(value: Column, most: int) -> Rows:
    """Return, in order, the rows of the least and greatest value of each of `most` / 3 stretches; all of a short one.

    Where a stretch is broken, the first row without a number stays too, so that the line is.
    """
    if value.size <= most:
        return np.arange(value.size)
    length = stretch(value.size, most)
    count = -(-value.size // length)
    padded = np.full(count * length, value[-1])
    padded[: value.size] = value
    stretches = padded.reshape(count, length)
    missing = np.isnan(stretches)
    firsts = length * np.arange(count)
    least = firsts + np.argmin(np.where(missing, np.inf, stretches), axis=1)
    greatest = firsts + np.argmax(np.where(missing, -np.inf, stretches), axis=1)
    broken = (firsts + np.argmax(missing, axis=1))[missing.any(axis=1)]
    rows = np.unique(np.concatenate([least, greatest, broken]))
    return rows[rows < value.size]


def stretch(count: int, most: int = MOST_SERIES_POINTS) -> int:
    """Return how many samples of a series longer than `most` stand for two points and a break."""
    return -(-count // (most // 3))


def round_values(values: Column, decimals: int) -> list[float | None]:
    """Return n numbers for JSON, of (n,); None for what is not a number."""
    kept = np.round(values, decimals).tolist()
    return [each if np.isfinite(each) else None for each in kept]


def significant(values: Column, digits: int = 5) -> list[float | None]:
    """Return n numbers for JSON, of (n,), rounded to significant digits; None for what is not a number."""
    return [float(f"{each:.{digits}g}") if np.isfinite(each) else None for each in values.tolist()]

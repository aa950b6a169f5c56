"""The measured pressure between its samples: what a stem is driven by.

It is m + d, m the command behind the lag that is found with it (`workbench.data.pressure_lag`), and d what was measured
beyond that, taken for a straight line from sample to sample: noise of a supply, hysteresis, whatever else is between
the two. The stem is driven by the means of m + d over the parts of a sample.

So a step that an I/P answers within a sample is one, and not halved over it. And a stem that the noise breaks loose
leaves when it does, not with the next sample: taken so, all slips would be mistimed by up to a sample, which an effect
that makes them slower would seem to explain.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from workbench.data.pressure_lag import command_followed_pa, pressure_lag_s


def means_between_samples_pa(
    period_s: float, command_pa: Column, pressure_pa: Column, segments: tuple[tuple[int, int], ...], parts: int
) -> Column:
    """Return the mean pressures over the parts from each sample to the next, Pa, (n, parts).

    After a segment's last sample it is what was measured then, as it is at rows of none.

    Args:
        period_s: of the samples, h; where theirs differ, the line takes what that makes of m.
        command_pa: held from its sample on, (n,).
        pressure_pa: measured, (n,).
        segments: half-open ranges of rows that follow each other.
        parts: of a sample, equal ones.
    """
    rows = [slice(*each) for each in segments]
    T = pressure_lag_s(period_s, command_pa, pressure_pa, rows)
    ends_s = np.linspace(0.0, period_s, parts + 1)
    left = -np.diff(np.exp(-ends_s / T)) * T / np.diff(ends_s)
    middles = 0.5 * (ends_s[:-1] + ends_s[1:]) / period_s
    means_pa = np.repeat(pressure_pa[:, None], parts, axis=1)
    for each in rows:
        u, p = command_pa[each], pressure_pa[each]
        m = command_followed_pa(period_s, T, u, p)
        d = p - m
        followed_pa = u[:-1, None] + np.outer(m[:-1] - u[:-1], left)
        means_pa[each.start : each.stop - 1] = followed_pa + d[:-1, None] + np.outer(np.diff(d), middles)
    return means_pa


def ends_of_parts_pa(
    time_s: Column, command_pa: Column, pressure_pa: Column, followed_pa: Column, lag_s: float, shares: Sequence[float]
) -> NDArray[np.float64]:
    """Return the pressures at shares of the time from each sample to the next, Pa, (n - 1, shares).

    Args:
        time_s: of samples, (n,).
        command_pa: held from its sample on, (n,).
        pressure_pa: measured, (n,).
        followed_pa: m, (n,).
        lag_s: T.
        shares: ascending to 1.
    """
    s, u = np.array([0.0, *shares]), command_pa[:-1, None]
    goes_pa = u + (followed_pa[:-1, None] - u) * np.exp(-np.outer(np.diff(time_s), s) / lag_s)
    d_pa, next_pa = pressure_pa[:-1] - goes_pa[:, 0], pressure_pa[1:] - goes_pa[:, -1]
    return (goes_pa + d_pa[:, None] + np.outer(next_pa - d_pa, s))[:, 1:]

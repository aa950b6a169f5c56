"""The measured pressure between its samples: what a stem is driven by while a sample is held.

The command u_i is in force from sample i to the next, h_i later. A pressure that follows it with a lag T is

    m_{i+1} = u_i + (m_i - u_i) e_i,   e_i = exp(-h_i / T),   mean over h_i   u_i + (m_i - u_i) (1 - e_i) T / h_i

What was measured beyond that, d_i = p_i - m_i, is taken for a straight line from sample to sample: noise of a supply,
hysteresis, whatever else is between the two. T is the one that leaves the least, mean |d - median d|; of those that do
so but for a hundredth the fastest, for of a lag far below a sample nothing shows.

So a step that an I/P answers within a sample is one, and not halved over it; and of a pressure that is slow against its
samples the mean is the middle of two, as it is of one without a command.
"""

from math import exp, log

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from config.recording import Column

FASTEST, SLOWEST = 1.0 / 300.0, 3e3
"""T over the period of the samples."""
NO_MORE = 1.01


def mean_between_samples_pa(
    period_s: float, command_pa: Column, pressure_pa: Column, segments: tuple[tuple[int, int], ...]
) -> Column:
    """Return the mean pressure from each sample to the next, Pa, (n,); of a segment's last one what is measured then.

    Args:
        period_s: of the samples, h; where theirs differ, the line takes what that makes of m.
        command_pa: held from its sample on, (n,).
        pressure_pa: measured, (n,).
        segments: half-open ranges of rows that follow each other; rows of none are given as measured.
    """
    rows = [slice(*each) for each in segments]

    def left_pa(log_share: float) -> float:
        T = period_s * exp(log_share)
        beyond = [pressure_pa[each] - _followed_pa(period_s, T, command_pa[each], pressure_pa[each]) for each in rows]
        d = np.concatenate(beyond)
        return float(np.mean(np.abs(d - np.median(d))))

    found = minimize_scalar(left_pa, bounds=(log(FASTEST), log(SLOWEST)), method="bounded")
    fast = left_pa(log(FASTEST)) <= NO_MORE * float(found.fun)
    T = period_s * (FASTEST if fast else exp(float(found.x)))
    mean_pa = pressure_pa.copy()
    for each in rows:
        u, p = command_pa[each], pressure_pa[each]
        m = _followed_pa(period_s, T, u, p)
        d = p - m
        followed_pa = u + (m - u) * -np.expm1(-period_s / T) * T / period_s
        mean_pa[each.start : each.stop - 1] = followed_pa[:-1] + 0.5 * (d[:-1] + d[1:])
    return mean_pa


def _followed_pa(period_s: float, T: float, u: Column, p: Column) -> Column:
    """Return m, Pa, (n,), from the first measured pressure on."""
    e = exp(-period_s / T)
    m, _ = lfilter([0.0, 1.0 - e], [1.0, -e], u, zi=[p[0]])
    return np.asarray(m)

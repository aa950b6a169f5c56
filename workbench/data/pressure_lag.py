"""The lag by which a measured pressure follows its command, and what it was where it was not measured.

    m(t) = u_i + (m_i - u_i) exp(-t / T)     a time t after sample i;  m_{i+1} = m(h)

u_i the command in force from sample i to the next, h later. T is the one that leaves the least of what was measured
beyond that, d_i = p_i - m_i: mean |d - median d|; of those that do so but for a hundredth the fastest, for of a lag far
below a sample nothing shows. Where the pressure was not measured it is m + d, d the straight line between those samples
that were: one of p would miss all that was commanded meanwhile.
"""

from collections.abc import Sequence
from math import exp, log

import numpy as np
from numpy.typing import NDArray

from config.recording import Column

FASTEST, SLOWEST = 1.0 / 300.0, 3e3
"""T over the period of the samples."""
NO_MORE = 1.01


def without_gaps_pa(
    time_s: Column,
    command_pa: Column,
    pressure_pa: Column,
    segments: tuple[tuple[int, int], ...],
    known: NDArray[np.bool_],
) -> Column:
    """Return a pressure, Pa, (n,), with what the command makes of it where it was not measured.

    Args:
        time_s: of the samples, (n,).
        command_pa: held from its sample on, (n,).
        pressure_pa: measured, (n,); whatever it is where it was not.
        segments: half-open ranges of rows that follow each other.
        known: where it was measured, (n,).
    """
    whole_pa = np.where(known, pressure_pa, command_pa)
    rows = [slice(*each) for each in segments if known[slice(*each)].any()]
    if not rows:
        return whole_pa
    period_s = float(np.median(np.concatenate([np.diff(time_s[each]) for each in rows])))
    T = pressure_lag_s(period_s, command_pa, whole_pa, rows, known)
    for each in rows:
        m, there = command_followed_pa(period_s, T, command_pa[each], whole_pa[each]), known[each]
        d = (whole_pa[each] - m)[there]
        whole_pa[each] = m + np.interp(time_s[each], time_s[each][there], d)
    return whole_pa


def pressure_lag_s(
    period_s: float,
    command_pa: Column,
    pressure_pa: Column,
    rows: Sequence[slice],
    known: NDArray[np.bool_] | None = None,
) -> float:
    """Return T, s, by what was measured in some rows; `known`, (n,), says where it was."""
    from scipy.optimize import minimize_scalar  # takes as long to load as all else together

    def left_pa(log_share: float) -> float:
        T = period_s * exp(log_share)
        beyond = [
            pressure_pa[each] - command_followed_pa(period_s, T, command_pa[each], pressure_pa[each]) for each in rows
        ]
        d = np.concatenate([d if known is None else d[known[each]] for d, each in zip(beyond, rows, strict=True)])
        return float(np.mean(np.abs(d - np.median(d))))

    found = minimize_scalar(left_pa, bounds=(log(FASTEST), log(SLOWEST)), method="bounded")
    fast = left_pa(log(FASTEST)) <= NO_MORE * float(found.fun)
    return period_s * (FASTEST if fast else exp(float(found.x)))


def command_followed_pa(period_s: float, T: float, u: Column, p: Column) -> Column:
    """Return m, Pa, (n,), from the first measured pressure on; zero apart, for what p is above u mostly is no lag."""
    from scipy.signal import lfilter

    e = exp(-period_s / T)
    m, _ = lfilter([0.0, 1.0 - e], [1.0, -e], u, zi=[p[0] - np.median(p - u)])
    return np.asarray(m)

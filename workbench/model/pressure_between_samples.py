"""The measured pressure between its samples: what a stem is driven by.

The command u_i is in force from sample i to the next, h later. A pressure that follows it with a lag T is

    m(t) = u_i + (m_i - u_i) exp(-t / T)     a time t after sample i;  m_{i+1} = m(h)

What was measured beyond that, d_i = p_i - m_i, is taken for a straight line from sample to sample: noise of a supply,
hysteresis, whatever else is between the two. T is the one that leaves the least, mean |d - median d|; of those that do
so but for a hundredth the fastest, for of a lag far below a sample nothing shows. The stem is driven by the means of
m + d over the parts of a sample. Where the pressure was not measured, as many samples long as that may be, it is m + d
too, d the line between those that were.

So a step that an I/P answers within a sample is one, and not halved over it. And a stem that the noise breaks loose
leaves when it does, not with the next sample: taken so, all slips would be mistimed by up to a sample, which an effect
that makes them slower would seem to explain.
"""

from collections.abc import Sequence
from math import exp, log

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.signal import lfilter

from config.recording import Column

FASTEST, SLOWEST = 1.0 / 300.0, 3e3
"""T over the period of the samples."""
NO_MORE = 1.01


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


def without_gaps_pa(
    period_s: float,
    command_pa: Column,
    pressure_pa: Column,
    segments: tuple[tuple[int, int], ...],
    known: NDArray[np.bool_],
) -> Column:
    """Return a pressure, Pa, (n,), with what the command makes of it where it was not measured.

    A straight line over a gap would miss all that was commanded in it.

    Args:
        period_s: of the samples.
        command_pa: held from its sample on, (n,).
        pressure_pa: measured, (n,); whatever it is where it was not.
        segments: half-open ranges of rows that follow each other.
        known: where it was measured, (n,).
    """
    whole_pa, rows = pressure_pa.copy(), [slice(*each) for each in segments if known[slice(*each)].any()]
    for each in rows:
        if not known[each.start]:
            whole_pa[each.start] = command_pa[each.start]
    if not rows:
        return whole_pa
    T = pressure_lag_s(period_s, command_pa, whole_pa, rows, known)
    for each in rows:
        m, there = command_followed_pa(period_s, T, command_pa[each], whole_pa[each]), known[each]
        at = np.arange(m.size)
        whole_pa[each] = m + np.interp(at, at[there], (whole_pa[each] - m)[there])
    return whole_pa


def pressure_lag_s(
    period_s: float,
    command_pa: Column,
    pressure_pa: Column,
    rows: Sequence[slice],
    known: NDArray[np.bool_] | None = None,
) -> float:
    """Return T, s, by what was measured in some rows; `known`, (n,), says where it was."""

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
    """Return m, Pa, (n,), from the first measured pressure on."""
    e = exp(-period_s / T)
    m, _ = lfilter([0.0, 1.0 - e], [1.0, -e], u, zi=[p[0]])
    return np.asarray(m)

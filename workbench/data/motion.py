"""Where the stem moves: velocity over a few samples, and the slips, the same for a measurement and a simulation.

    v_i = (x_(i+w) - x_(i-w)) / (t_(i+w) - t_(i-w)),  w = 2;   moving where |x_(i+w) - x_(i-w)| > 5 sqrt 2 sigma

A slip is a run of moving samples of one direction that covers more than 6 sigma.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from config.recording import Column

REACH = 2
NOTICED = 5.0 * 2**0.5
COVERED = 6.0
BAND, AT_ONCE, LONGEST_REST = 8.0, 4, 50
"""Standard deviations within which a stem rests; samples of a rest, at least and at most."""
PARABOLA = 9
"""Samples of a local parabola, from which accelerations come."""

Directions = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Slip:
    """Rows first to last; from and to in m; direction +1 opening, -1 closing."""

    first: int
    last: int
    from_m: float
    to_m: float
    direction: int

    @property
    def travel_m(self) -> float:
        """How far it goes, positive."""
        return abs(self.to_m - self.from_m)


def velocity_m_per_s(time_s: Column, position_m: Column) -> Column:
    """Return the velocity at each sample, m/s, (n,); NaN next to what is not a number, 0 at the ends.

    Args:
        time_s: s, (n,).
        position_m: m, (n,).
    """
    velocity = np.zeros(position_m.size)
    w = REACH
    velocity[w:-w] = (position_m[2 * w :] - position_m[: -2 * w]) / (time_s[2 * w :] - time_s[: -2 * w])
    return velocity


def acceleration_m_per_s2(position_m: Column, period_s: float) -> Column:
    """Return the acceleration at each sample, m/s^2, (n,), by local parabolas; at the ends that of the outermost one.

    Args:
        position_m: m, (n,), at least `PARABOLA` samples.
        period_s: between samples, s.
    """
    from scipy.signal import savgol_filter  # takes as long to load as all else together

    acceleration: Column = savgol_filter(position_m, PARABOLA, 2, deriv=2, delta=period_s)
    return acceleration


def directions(position_m: Column, noise_m: float) -> Directions:
    """Return +1 where the stem moves up, -1 down, 0 where it may be at rest; (n,) as the positions, m."""
    across = np.zeros(position_m.size)
    across[REACH:-REACH] = position_m[2 * REACH :] - position_m[: -2 * REACH]
    across[~np.isfinite(across)] = 0.0
    return np.where(np.abs(across) > NOTICED * noise_m, np.sign(across), 0.0).astype(np.int64)


def rests_first(position_m: Column, noise_m: float, held: int = 0) -> int | None:
    """Return the row of an unbroken stretch of positions, m, (n,), at which the stem first rests; None if nowhere.

    0 where its first samples, `AT_ONCE` and those up to the first change of the command, lie in a band, or `AT_ONCE` on
    a straight line: at rest, or at a velocity that they tell. Else it rests where it stays, within that band, for as
    many samples as it took to get there, `AT_ONCE` to `LONGEST_REST`.

    Args:
        position_m: m, (n,).
        noise_m: standard deviation of the noise, m.
        held: samples for which the command stays what it was at the first: what moves the stem by then was on its way
            before the record, and nothing there tells how far.
    """
    rows = np.flatnonzero(np.isfinite(position_m))
    x = position_m[rows]
    band_m = BAND * noise_m
    left = np.flatnonzero(np.abs(x[: max(LONGEST_REST + 1, held)] - x[:1]) > band_m)
    if not left.size or rows[left[0]] >= max(AT_ONCE, held):
        return 0
    if left[0] < AT_ONCE and _is_straight(x[:AT_ONCE], 0.5 * band_m):
        return 0
    row = int(left[0])
    while row < x.size:
        stay = min(max(AT_ONCE, row), LONGEST_REST)
        if row + stay > x.size:
            return None
        off = np.flatnonzero(np.abs(x[row : row + stay] - x[row]) > band_m)
        if not off.size:
            return int(rows[row])
        row += 1
    return None


def _is_straight(position_m: Column, within_m: float) -> bool:
    """Return whether samples, m, (n,), lie on a straight line, by their numbers."""
    line = np.polynomial.Polynomial.fit(np.arange(position_m.size), position_m, 1)
    return bool(np.max(np.abs(position_m - line(np.arange(position_m.size)))) < within_m)


def slips(position_m: Column, noise_m: float) -> tuple[Slip, ...]:
    """Return the slips of an unbroken stretch of positions, m, (n,), in order."""
    way = directions(position_m, noise_m)
    edges = np.flatnonzero(np.diff(way)) + 1
    firsts = np.concatenate([[0], edges])
    lasts = np.concatenate([edges, [way.size]]) - 1
    found = []
    for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True):
        direction = int(way[first])
        if direction == 0:
            continue
        from_m = float(position_m[max(0, first - REACH)])
        to_m = float(position_m[min(way.size - 1, last + REACH)])
        if direction * (to_m - from_m) > COVERED * noise_m:
            found.append(Slip(first, last, from_m, to_m, direction))
    return tuple(found)

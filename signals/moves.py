"""Rests and moves of a sampled position: the events of a valve that sticks.

    D_w(i) = mean(x_i+1 .. x_i+w) - mean(x_i-w+1 .. x_i)     it moves from i to i + 1 where |D_w| > c sigma sqrt(2/w)

for w = 1, 2, 4, ... samples, the narrow windows first: a window that holds a motion seen already tells no other. What
lies between two motions is a rest. A move begins after the last sample that lies at the rest before it, and ends with
the first that lies at the rest after it.

A rest must show: between two moves the slope a of the samples must be less than half that of the whole, by 3
deviations, and then less than half that of the slower move,

    |a| + 3 sigma sqrt(12 / L^3) < |x_e - x_b| / (2 (e - b))     L samples of it; b, e where the whole, or the slower
                                                                 of the two moves, begins and ends

else both are one: a stem that slides slowly, seen through noise, is no stem that sticks and slips, and what goes on no
faster than between them is the end of the move before, as behind a lag. Where the stem turns, it is the faster move.
What comes back to where it was, without a rest there, has moved if it went `OUT_AND_BACK`.

A slip is a part of a move in one direction: the move is cut where it turns back by so much.

x position, m; sigma standard deviation of its noise, m; c = `SEEN_DEVIATIONS`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Ways = npt.NDArray[np.int64]
Run = tuple[int, int]
"""Samples at rest last before a motion and first after it."""
Leg = tuple[int, int, int]
"""Rows first and last, and the direction, +1 or -1."""

SEEN_DEVIATIONS = 5.0
"""Standard deviations of D_w beyond which it is no noise: of 12 000 samples in 7 widths one in 20 records has one."""
WIDTHS = (1, 2, 4, 8, 16, 32, 64)
"""Samples of a window: a stem that creeps by a noise in 60 samples is still seen to move."""
AT_REST = 2.5
"""Standard deviations of the noise within which a sample lies at a rest."""
FEWEST_REST_SAMPLES = 3
"""Samples of a rest between two moves: of fewer no slope tells that the stem stood still."""
COVERED = 6.0
"""Standard deviations of the noise that a move covers: what creeps by less is a rest, of a sensor that settles."""
OUT_AND_BACK = 12.0
"""Standard deviations that a stem goes back by, to have turned: noise alone spans 7 in a few hundred samples."""
AT_ONCE, STRAIGHT_DEVIATIONS = 4, 4.0
"""Samples in which a record shows that it begins at rest, or at which velocity; off a straight line, in noises."""
SURELY, SLOWER = 3.0, 0.5
"""Deviations of the slope of a rest, and the share of the slope beside it, below which it is one."""


@dataclass(frozen=True, slots=True)
class Move:
    """Rows: at rest last before it, and first after it; -1, or the number of rows, where the record ends in it."""

    before: int
    after: int


@dataclass(frozen=True, slots=True)
class Slip:
    """Rows at rest, or turning, last before it and first after it; from, to in m; direction +1 opening, -1 closing."""

    first: int
    last: int
    from_m: float
    to_m: float
    direction: int

    @property
    def travel_m(self) -> float:
        """How far it goes, positive."""
        return abs(self.to_m - self.from_m)


class Rest(NamedTuple):
    """Rows first to end (half open) at rest at a position, m; direction of the slip that ended here, 0 if none did."""

    first: int
    end: int
    position_m: float
    direction: int


def moving(position_m: Array, noise_m: float) -> Mask:
    """Return whether the stem moves from each sample to the next, (n - 1,).

    Args:
        position_m: m, (n,), n >= 1; a sample that is not a number is as the one before it.
        noise_m: standard deviation of the noise, m.
    """
    position_m = _filled(position_m)
    n = position_m.size
    moves = np.zeros(n - 1, dtype=np.bool_)
    total = np.concatenate([[0.0], np.cumsum(position_m - position_m[0])])
    for w in WIDTHS:
        if 2 * w > n:
            break
        mean = (total[w:] - total[:-w]) / w
        across = np.abs(mean[w:] - mean[:-w])
        seen_before = np.concatenate([[0], np.cumsum(moves)])
        # The window of `across[j]` holds the steps j .. j + 2 w - 2; its middle one is j + w - 1.
        clear = seen_before[2 * w - 1 :] == seen_before[: n - 2 * w + 1]
        found = clear & (across > SEEN_DEVIATIONS * noise_m * np.sqrt(2.0 / w))
        middle = np.flatnonzero(found) + w - 1
        for reach in range(-(w // 2), w // 2 + 1):
            moves[middle + reach] = True
    return moves


def moves(position_m: Array, noise_m: float) -> tuple[Move, ...]:
    """Return the moves of an unbroken stretch of positions, m, (n,), in their order; those between which no rest shows
    are one.

    A sample that is not a number is as the one before it.
    """
    x = _filled(position_m)
    if x.size < 2:
        return ()
    steps = moving(x, noise_m)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], steps, [False]])))
    runs = [(int(first), int(end)) for first, end in zip(edges[::2], edges[1::2], strict=True)]
    # Steps first .. end - 1 move: samples `first` and `end` are the last and the next at rest.
    apart = _joined(runs, lambda one, other: not _rests_between(x, noise_m, one, other, ((one[0], other[1]),)))
    shown = [run for run in apart if _covers(x, noise_m, run)]
    apart = _joined(shown, lambda one, other: not _rests_between(x, noise_m, one, other, (one, other)))
    return tuple(_fitted(x, noise_m, apart))


def slips(position_m: Array, noise_m: float) -> tuple[Slip, ...]:
    """Return the slips of an unbroken stretch of positions, m, (n,), in order."""
    x = _filled(position_m)
    found = []
    for move in moves(x, noise_m):
        first, end = max(move.before, 0), min(move.after, x.size - 1)
        ways = legs(x[first : end + 1], OUT_AND_BACK * noise_m)
        begins = [first, *(first + row for row, _, _ in ways[1:])]
        for a, b in zip(begins, [*(first + row for _, row, _ in ways[:-1]), end], strict=True):
            if abs(x[b] - x[a]) > COVERED * noise_m:
                found.append(Slip(a, b, float(x[a]), float(x[b]), 1 if x[b] > x[a] else -1))
    return tuple(found)


def directions(position_m: Array, noise_m: float) -> Ways:
    """Return +1 where the stem moves up, -1 down, 0 where it rests; (n,) as the positions, m."""
    way = np.zeros(position_m.size, dtype=np.int64)
    for each in slips(position_m, noise_m):
        way[each.first + 1 : each.last + 1] = each.direction
    return way


def rests(position_m: Array, noise_m: float) -> tuple[Rest, ...]:
    """Return the rests of an unbroken stretch of positions, m, (n,), in order, of `FEWEST_REST_SAMPLES` at least."""
    x = _filled(position_m)
    found, here = [], moves(x, noise_m)
    ended_by = {each.last: each.direction for each in slips(x, noise_m)}
    begins = [0, *(each.after for each in here)]
    for first, end in zip(begins, [*(each.before + 1 for each in here), x.size], strict=True):
        if end - first >= FEWEST_REST_SAMPLES:
            direction = ended_by.get(first, 0)
            found.append(Rest(first, end, float(np.mean(x[first:end])), direction))
    return tuple(found)


def rests_first(position_m: Array, noise_m: float, held: int = 0) -> int | None:
    """Return the row of an unbroken stretch of positions, m, (n,), at which the stem first rests; None if nowhere.

    0 where it does not leave its place in the first samples, `AT_ONCE` and those up to the first change of the command,
    or `AT_ONCE` lie on a straight line: at rest, or at a velocity that they tell.

    Args:
        position_m: m, (n,).
        noise_m: standard deviation of the noise, m.
        held: samples for which the command stays what it was at the first: what moves the stem by then was on its way
            before the record, and nothing there tells how far.
    """
    x = _filled(position_m)
    first = next(iter(moves(x, noise_m)), None)
    if first is None:
        return 0
    level = float(np.median(x[: max(first.before, 0) + 1]))
    left = int(np.argmax(np.abs(x - level) > COVERED * noise_m))
    if left >= max(AT_ONCE, held):
        return 0
    if left < AT_ONCE and _is_straight(x[:AT_ONCE], STRAIGHT_DEVIATIONS * noise_m):
        return 0
    return first.after if first.after < x.size else None


def _is_straight(position_m: Array, within_m: float) -> bool:
    """Return whether samples, m, (n,), lie on a straight line, by their numbers."""
    line = np.polynomial.Polynomial.fit(np.arange(position_m.size), position_m, 1)
    return bool(np.max(np.abs(position_m - line(np.arange(position_m.size)))) < within_m)


def legs(position_m: Array, band_m: float) -> list[Leg]:
    """Return between which rows positions, m, (n,), finite, go one way, and which: they turn by more than a band, m.

    One begins where they set out for good, from the band's other side in one go, and ends where they are farthest, the
    last with them; none where they never leave a band.
    """
    x = position_m.tolist()
    found: list[Leg] = []

    def set_out(row: int, way: int) -> int:
        while row > 0 and way * (x[row] - x[row - 1]) > 0.0:
            row -= 1
        return row

    way = begun = extreme = low = high = 0
    for i, here in enumerate(x):
        if way == 0:
            low, high = (i if here < x[low] else low), (i if here > x[high] else high)
            if x[high] - x[low] > band_m:
                way, extreme = (1 if high == i else -1), i
                begun = set_out(i, way)
        elif way * (here - x[extreme]) > 0.0:
            extreme = i
        elif way * (x[extreme] - here) > band_m:
            found.append((begun, extreme, way))
            way, extreme = -way, i
            begun = set_out(i, way)
    return [*found, (begun, len(x) - 1, way)] if way else []


def _covers(x: Array, noise_m: float, run: Run) -> bool:
    """Return whether a stem goes far enough for it to be a move."""
    first, end = run
    return bool(abs(x[end] - x[first]) > COVERED * noise_m or np.ptp(x[first : end + 1]) > OUT_AND_BACK * noise_m)


def _joined(runs: list[Run], belong: Callable[[Run, Run], bool]) -> list[Run]:
    """Join neighbours that belong together, from the first on."""
    joined: list[Run] = []
    for run in runs:
        joined.append(run)
        while len(joined) > 1 and belong(*joined[-2:]):
            joined[-2:] = [(joined[-2][0], joined[-1][1])]
    return joined


def _speed(x: Array, run: Run) -> float:
    """Return how fast the stem goes in a run, m a sample, whichever way."""
    return float(np.ptp(x[run[0] : run[1] + 1])) / (run[1] - run[0])


def _rests_between(x: Array, noise_m: float, one: Run, other: Run, beside: tuple[Run, ...]) -> bool:
    """Return whether the samples between two moves show a rest, against the slowest run beside it; where the stem turns
    there, against the faster move."""
    first, last = one[1], other[0]
    count = last - first + 1
    if count < FEWEST_REST_SAMPLES:
        return False
    rows = np.arange(count) - 0.5 * (count - 1)
    square = float(rows @ rows)
    slope = float(rows @ x[first : last + 1]) / square
    turns = (x[one[1]] - x[one[0]]) * (x[other[1]] - x[other[0]]) < 0.0
    speed = max(_speed(x, one), _speed(x, other)) if turns else min(_speed(x, each) for each in beside)
    return bool(abs(slope) + SURELY * noise_m / np.sqrt(square) < SLOWER * speed)


def _filled(position_m: Array) -> Array:
    known = np.isfinite(position_m)
    if not known.any():
        return np.zeros(position_m.size)
    rows = np.maximum.accumulate(np.where(known, np.arange(position_m.size), 0))
    filled = position_m[rows]
    filled[~np.isfinite(filled)] = position_m[known][0]
    return filled


def _fitted(x: Array, noise_m: float, runs: list[Run]) -> list[Move]:
    """Move each end of a run to where the rest beside it ends; one sample that lies off does not end the rest after."""
    bounds = [0, *[row for run in runs for row in run], x.size - 1]
    rests = [(bounds[i], bounds[i + 1]) for i in range(0, len(bounds), 2)]
    within = AT_REST * noise_m
    known = [(begin, end, float(np.median(x[begin : end + 1]))) for begin, end in rests]
    found = []
    for ((begins, _, before), (_, ends, after)), (first, end) in zip(pairwise(known), runs, strict=True):
        row, last = first, end
        while row > begins and abs(x[row] - before) > within:
            row -= 1
        while row + 1 < end and abs(x[row + 1] - before) <= within:
            row += 1
        while last < ends and abs(x[last] - after) > within:
            last += 1
        while last - 1 > row and np.min(np.abs(x[max(last - 2, row + 1) : last] - after)) <= within:
            last -= 1
        if abs(after - before) > COVERED * noise_m or _covers(x, noise_m, (row, last)):
            found.append(Move(-1 if first == 0 else row, x.size if end == x.size - 1 else last))
    return found

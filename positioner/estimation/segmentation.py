"""The motions of one direction in a record: rest, reversal and the time at an end stop are left out.

The straight line's slope over a window of length T about each sample shows whether the stem moves there. White noise σ
sampled every h leaves the slope a standard deviation of sqrt(12 h) σ / T^(3/2); T is chosen so that it is a fifth of
the slowest motion that is to be detected, and no shorter than six samples:

    T = (sqrt(12 h) σ / σ_v)^(2/3),    σ_v = threshold

A motion is where |slope| exceeds threshold + 4 σ_v, with what lies around it as long as the slope keeps its sign above
the threshold. Within T of its ends it is trimmed by the positions themselves: it begins where the positions leave the
resting place before it, and ends where they reach the one after it, which an end stop is too. A motion into a stop is
so cut at the impact, whatever the pressure does afterwards.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from math import sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from positioner.estimation.array import Array
from positioner.estimation.motion_segment import MotionSegment

FEWEST_SAMPLES = 6
"""Samples in a slope's window, and in a motion."""
STANDS_OUT = 4.0
"""Standard deviations beyond which a slope or a position is no chance."""
REST_WINDOWS, REST_SHARE = 4, 8
"""The rest before a motion is looked at for so many windows, or this part of the motion, and no further than the motion
before it."""
JUMP = 100.0
"""Ratio of a step of the pressure to those after it that makes it the one that moved the stem."""
BROKEN = 20.0
"""A step of time longer than so many median ones breaks a motion in two."""


@dataclass(frozen=True, slots=True)
class Segmentation:
    """The motions of a record, and what lies between them.

    Attributes:
        segments: motions, in order of time.
        rests: (begin, end) rows of the rests between them, for what breaks away and what does not.
        too_short: motions that are too short to be fitted.
        moving_share: part of the record's time in motion.
        stretches: what moves between two rests, a motion each though it seems to turn round; with what follows each.
    """

    segments: tuple[MotionSegment, ...]
    rests: tuple[tuple[int, int], ...]
    too_short: int
    moving_share: float
    stretches: tuple["Stretch", ...] = ()


class Stretch(NamedTuple):
    """Rows of a stretch of motion; the rest before it ends at the first, the one after it lasts until the last."""

    before: int
    begin: int
    end: int
    after: int


def find_motions(
    time_s: Array, position_m: Array, pressure_pa: Array, noise_std_m: float, threshold_m_per_s: float
) -> Segmentation:
    """Find the motions of a record.

    Args:
        time_s: (N,), increasing time stamps.
        position_m: (N,), measured.
        pressure_pa: (N,), as in `MotionSegment`.
        noise_std_m: of the positions.
        threshold_m_per_s: velocity below which the stem counts as stopped.
    """
    if len(time_s) < 2 * FEWEST_SAMPLES:
        return Segmentation((), (), 0, 0.0)
    period_s = float(np.median(np.diff(time_s)))
    window = _window(period_s, noise_std_m, threshold_m_per_s, len(time_s))
    slope = slopes(time_s, position_m, window)
    # Rounding leaves a slope of its own where nothing moves.
    std = max(sqrt(12.0 / window) * noise_std_m / (window * period_s), 1e-3 * threshold_m_per_s)
    found, too_short, rests, segments = _moving(slope, threshold_m_per_s, std), 0, [], []
    before = 0
    for number, (begin, end, direction) in enumerate(found):
        after = found[number + 1][0] if number + 1 < len(found) else len(time_s)
        segment, bounds = _trimmed(
            time_s, position_m, pressure_pa, Stretch(before, begin, end, after), direction, window, noise_std_m
        )
        pieces = _unbroken(segment, period_s) if segment is not None else []
        too_short += not pieces
        segments += pieces
        rests.append((before, bounds[0]))
        before = bounds[1]
    rests.append((before, len(time_s)))
    moving = sum(end - begin for begin, end, _ in found) / len(time_s)
    rested = tuple(each for each in rests if each[1] > each[0])
    return Segmentation(tuple(segments), rested, too_short, moving, _stretches(found, window, len(time_s)))


def _stretches(found: list[tuple[int, int, int]], window: int, count: int) -> tuple[Stretch, ...]:
    """Return the stretches of motions, (begin, end, direction) each, between which there is no rest."""
    joined: list[list[int]] = []
    for begin, end, _ in found:
        if joined and begin - joined[-1][1] <= 2 * window:
            joined[-1][1] = end
        else:
            joined.append([begin, end])
    ends = [0, *(end for _, end in joined)]
    begins = [*(begin for begin, _ in joined), count]
    return tuple(Stretch(ends[at], begin, end, begins[at + 1]) for at, (begin, end) in enumerate(joined))


def whole_stretch(
    stretch: Stretch,
    direction: int,
    time_s: Array,
    position_m: Array,
    pressure_pa: Array,
    noise_std_m: float,
    threshold_m_per_s: float,
) -> MotionSegment | None:
    """Return a stretch as one motion in a direction; None where it is too short.

    Args:
        stretch: of a record.
        direction: +1 up, -1 down.
        time_s, position_m, pressure_pa, noise_std_m, threshold_m_per_s: of the record, as of `find_motions`.
    """
    window = _window(float(np.median(np.diff(time_s))), noise_std_m, threshold_m_per_s, len(time_s))
    return _trimmed(time_s, position_m, pressure_pa, stretch, direction, window, noise_std_m)[0]


def _window(period_s: float, noise_std_m: float, threshold_m_per_s: float, count: int) -> int:
    length_s = (sqrt(12 * period_s) * noise_std_m / threshold_m_per_s) ** (2 / 3)
    return int(min(max(FEWEST_SAMPLES, round(length_s / period_s)), count // 2))


def slopes(time_s: Array, position_m: Array, window: int) -> Array:
    """Return the straight line's slope over `window` samples about each sample, (N,), m/s.

    At the ends it is that of the first and of the last window.

    Args:
        time_s: (N,), increasing.
        position_m: (N,).
        window: samples, 2 to N.

    >>> slopes(np.arange(5.0), 2.0 * np.arange(5.0), 3).tolist()
    [2.0, 2.0, 2.0, 2.0, 2.0]
    """
    t, x = time_s - time_s[0], position_m - position_m[0]

    def sums(values: Array) -> Array:
        total = np.append(0.0, np.cumsum(values))
        return np.asarray(total[window:] - total[:-window])

    middle = np.arange(len(t) - window + 1)
    # Times and positions relative to each window's first sample: no difference of large numbers.
    n, t_0, x_0 = float(window), t[middle], x[middle]
    s_t, s_x = sums(t) - n * t_0, sums(x) - n * x_0
    s_tt = sums(t * t) - 2 * t_0 * sums(t) + n * t_0 * t_0
    s_tx = sums(t * x) - t_0 * sums(x) - x_0 * sums(t) + n * t_0 * x_0
    inner = (n * s_tx - s_t * s_x) / np.maximum(n * s_tt - s_t * s_t, 1e-300)
    left = window // 2
    return np.concatenate((np.full(left, inner[0]), inner, np.full(len(t) - len(inner) - left, inner[-1])))


def _moving(slope: Array, threshold: float, std: float) -> list[tuple[int, int, int]]:
    """Return (begin, end, direction) of every motion, rows of the slopes."""
    found: list[tuple[int, int, int]] = []
    for direction in (1, -1):
        kept = direction * slope > threshold
        certain = direction * slope > threshold + STANDS_OUT * std
        found += [(begin, end, direction) for begin, end in _runs(kept) if certain[begin:end].any()]
    return sorted(found)


def _runs(flags: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False]))))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _trimmed(
    time_s: Array,
    position_m: Array,
    pressure_pa: Array,
    rows: Stretch,
    direction: int,
    window: int,
    noise_std_m: float,
) -> tuple[MotionSegment | None, tuple[int, int]]:
    """Return the segment between the end of the motion before and the begin of the next, and its own rows."""
    before, begin, end, after = rows
    travel = direction * position_m
    band = STANDS_OUT * noise_std_m + 1e-9
    rests_from = max(before, begin - max(REST_WINDOWS * max(window, 2 * FEWEST_SAMPLES), (end - begin) // REST_SHARE))
    from_rest, starts = _leaves_rest(travel, rests_from, begin, end, band, window)
    if not from_rest and before == 0 and (jumped := _jumps_soon(pressure_pa, travel, band)):
        from_rest, rests_from, starts = True, 0, jumped
    stop = _reaches_rest(travel, begin, end, after, band, window)
    if stop - starts < 2 * FEWEST_SAMPLES:
        return None, (starts, max(stop, starts))
    first = rests_from if from_rest else starts
    return (
        MotionSegment(
            direction=direction,
            time_s=time_s[first:stop],
            position_m=position_m[first:stop],
            pressure_pa=pressure_pa[first:stop],
            begins=starts - first if from_rest else 0,
            earliest=max(0, starts - first - max(window, 3)) if from_rest else 0,
        ),
        (starts, stop),
    )


def _leaves_rest(travel: Array, rests_from: int, begin: int, end: int, band: float, window: int) -> tuple[bool, int]:
    """Return whether the motion begins from rest, and the last row that does not yet stand out of it."""
    around = travel[rests_from : min(end, begin + 2 * window)]
    known = max(FEWEST_SAMPLES, min(begin - rests_from - window // 2, len(around)), len(around) // 8)
    quiet = around[:known]
    level = float(np.median(quiet))
    if len(quiet) < FEWEST_SAMPLES or float(np.abs(quiet - level).max()) > 2 * band:
        return False, begin
    out = around > level + band
    twice = np.flatnonzero(out[:-1] & out[1:])  # one sample alone is chance
    if not len(twice) or twice[0] < FEWEST_SAMPLES:
        return False, begin
    return True, rests_from + int(twice[0]) - 1


def _jumps_soon(pressure_pa: Array, travel: Array, band: float) -> int:
    """Return the row after the jump of the pressure that moved the stem, soon after the record began; else 0.

    The rest before it is too short to be known by itself: where the stem is in one place, it rested until then.
    """
    jumps = np.abs(np.diff(pressure_pa[:200]))
    if len(jumps) <= FEWEST_SAMPLES:
        return 0
    after = int(jumps[:FEWEST_SAMPLES].argmax()) + 1
    alone = jumps[after - 1] > JUMP * np.delete(jumps, after - 1).max()
    return after if alone and float(np.ptp(travel[:after])) <= 2 * band else 0


def _reaches_rest(travel: Array, begin: int, end: int, after: int, band: float, window: int) -> int:
    """Return the row that ends the motion: where it comes within noise of the rest that follows, if one does."""
    if end >= len(travel):
        return end
    turned = max(end - window, begin)  # no rest follows: it turned, or bounced off a stop, somewhere in the window
    quiet = travel[min(end + window // 2, after) : after][: 4 * window]
    if len(quiet) < 3:
        return turned
    level = float(np.median(quiet))
    if float(np.abs(quiet - level).max()) > 2 * band:
        return turned
    reached = np.flatnonzero(travel[begin : min(end + window // 2, after)] >= level - band / 2)
    return begin + int(reached[0]) if len(reached) else end


def _unbroken(segment: MotionSegment, period_s: float) -> list[MotionSegment]:
    """Return the pieces of a motion between breaks of the record, each long enough to be fitted."""
    breaks = np.flatnonzero(np.diff(segment.time_s) > BROKEN * period_s) + 1
    edges = [0, *breaks.tolist(), len(segment.time_s)]
    return [
        replace(
            segment,
            time_s=segment.time_s[first:last],
            position_m=segment.position_m[first:last],
            pressure_pa=segment.pressure_pa[first:last],
            begins=max(0, segment.begins - first),
            earliest=max(0, segment.earliest - first),
        )
        for first, last in pairwise(edges)
        if last - max(first, segment.begins) >= 2 * FEWEST_SAMPLES
    ]

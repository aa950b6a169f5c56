"""The noise of a sampled position where the stem rests or goes evenly, and the quantum it is rounded to.

A record is cut into windows of w samples, w = 64 down to 3. Each has a scatter s about its mean, from 8 samples on
about a straight line, with k = w - 1 or w - 2 degrees of freedom. Where nothing moves s^2 / σ^2 is chi^2_k / k and
stays below c_k^2, its 99.5 % quantile; motion scatters by more, by anything. Hence σ is the scale that finds itself:

    S(σ) = rms of all s <= c_k σ        S(σ) = σ      the first, from below
    S(2 σ) <= 1.2 S(σ)                                no scatters of another origin go on where the noise's end
    sum (x_i+1 - x_i)^2 / 2 n = S^2                   white, within 20 %: what goes on moving is not,
    sum (x_i+1 - 2 x_i + x_i-1)^2 / 6 n = S^2         nor is what wanders
    corr(x, u) < 0.3, of few 0.5                      in the windows, for a drive u that it may follow
    less than a fifth of them below c_10 σ            the 10 % quantile: no quieter noise is mixed with this one

The last tells a stem at rest from one that goes evenly through a rounding that lies before the noise: q/√12 in motion
and nothing at rest, it is white and hangs on no drive, and the noise of both together is that of neither. Where the end
of the quieter noise is then not seen, for the other begins at twice it, both its ends must be those of chi^2 in windows
of 8 samples and more: no more than a fifth of them above c_90 σ either.

No window in which the stem is seen to move counts, whatever the sampling. Where no scale passes (fewer than 20 degrees
of freedom, motion from sample to sample throughout) the noise is unknown, which is None and not 0. Of widths that pass,
those within 1.25 times the least σ count, for motion only adds, and of these the longest that finds half as many
samples as any.

Where the drive is held for three windows, the stem rests in the last: what scatters there, about a parabola lest it
creep on, may be no more than 1.2 times the σ found. Else that was the white part of a noise that hangs together (a
filter before the rounding, the mains), and the noise is unknown, too.

A position rounded to q is taken with an even noise of q added, under which rounding becomes white. What is left, s^2,
lacks what the rounding of a stem at rest hides, for it rests at one place of the quantum for long:

    s^2 = σ_w^2 + q^2/12 - q^2/(2 π^2) sum_k exp(-(2 π k σ_w / q)^2) / k^2,      σ^2 = σ_w^2 + q^2/12

σ_w white noise before rounding; σ is what a reading is off by.

Where readings hardly ever change by one or two quanta, no noise of less than the least change was rounded: it would
come to the edge of a quantum in some rest. A dead band or a historian's compression held small changes back then, or
the sensor is that quiet; which, and what a reading is off by, the samples do not tell, and the noise is unknown. So it
is where readings are not rounded and stand still: a hundred thousandth of what they span stands for the quantum.

Where a window tells a noise about its line, the stem goes evenly, or a historian drew lines between the samples that it
kept. Of such a line nothing shows but how it was rounded. So if that, or hardly anything, is all that is found, windows
about their means tell nothing, and fewer than a quarter of all are level, as at rest, the noise is unknown.

A reading that stands still for n samples while others scatter is no rest, but a transmitter or a gateway that repeats
its last value. In N samples noise does so by a chance of N p^n, p = erf(q / (2 √2 σ_w)) amid a quantum. It is no less
than what amid a quantum makes as many readings change, to and fro, by two quanta and more as do so: within one, a stem
at rest near its edge flickers whatever the noise.

The running identification, which never has all samples
at once, measures by third differences d_k = x_k - 3 x_(k-1) + 3 x_(k-2) - x_(k-3), var d = 20 σ^2 (`noise_by_median`).
"""

from dataclasses import dataclass
from math import erf, log, pi, sqrt
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]

VARIANCE = 20.0
"""Of the third difference of white noise of variance 1."""
MEDIAN_OF_NORMAL = 0.6744897502
"""Median of |z|, z standard normal."""
WIDTHS = (64, 32, 16, 8, 5, 4, 3)
"""Samples of a window, the longest first."""
STRAIGHT = 8
"""Samples from which a window may go along a straight line; it then begins half a window after the one before."""
FEWEST_DEGREES_OF_FREEDOM, FEWEST_WINDOWS = 20.0, 8
"""Degrees of freedom that tell a noise, to 16 %; windows: of one alone nothing shows whether it is like others."""
LEAST_SHARE = 0.01
"""Of the windows: fewer may be still by chance."""
ALIKE_NOISE_FACTOR = 1.25
"""Ratio of the noises that two widths find, up to which they are one."""
AS_MANY = 0.5
"""Of the samples that another width finds: as many are enough."""
NORMAL_10, NORMAL_90, NORMAL_995 = -1.2816, 1.2816, 2.576
TENTH, MOST_OF_TENTH = 0.1, 0.2
"""Share of the windows beyond a 10 % quantile of chi^2; the largest, before chance, that still is one."""
ENOUGH_FOR_ENDS = 15.0
"""Independent windows that show both ends."""
NEXT, GAP, GROWS = 1.05, 2.0, 1.2
"""Ratio of one scale tried to the next; a scale above the noise's, up to which the rms may grow by so much."""
BEYOND = 1.25
"""Times the scale found: the rms up to there lacks none of the noise's windows."""
WHITE = 0.2
FOLLOWS = 0.3
"""Correlation with the drive from which a stem is not at rest."""
FOLLOWS_OF_FEW = 0.5
"""The same where so few samples are there that noise itself may come to more."""
LATEST_FOLLOWING_SAMPLES = 3
"""Samples by which the stem follows its drive at most."""
HELD_WIDTHS = (256, 128, 64, 32, 16)
HELD_FOR, PARABOLA = 3, 3
"""Windows; terms of what a stem that creeps on goes by in the last."""
RESTS, STILL = 0.1, 1.5
"""Share of these in which a stem rests, however slowly its pressure settles; times their most scatter up to which
others count."""
HARMONICS = np.arange(1, 8)
DIVISORS = range(1, 7)
"""The smallest step between two levels is so many quanta at most."""
ON_GRID, REACHES = 0.02, (10.5, 100.5, 1000.5, 10000.5)
"""Of a quantum, how far a step between levels may be off it; the steps that refine it, one after the other."""
FEW_STEPS, MANY_STEPS = 5, 50
"""Steps between levels that show a quantum: a tenth of all, but no fewer nor more than these."""
HELD_BACK, RARELY, FEWEST_CHANGES, REPEATED = 2.5, 0.1, 20, 0.05
"""Quanta below which no more than that share of so many changes is, where something holds small ones back; share of
readings that are not rounded and like the one before: of a stem that never rests all changes are large."""
HARDLY, MANY_WITHOUT = 1e-5, 0.1
"""Of what they span: readings that are not rounded and change by less are alike; share of windows without any noise."""
ROUNDING_ALONE, LEAST_LEVEL = 1.5, 0.25
"""Times q/√12 up to which what is found is rounding and hardly anything else; share of the windows that go nowhere."""
FROZEN_BY_CHANCE, FEWEST_FROZEN = 1e-6, 8
"""Chance, in all samples, of a run of like readings at rest, below which it is none; samples of a run at least."""
NEAR_QUANTA, LEAST_NOISY = 4.5, 0.02
"""Quanta by which a change may be noise's, and no move; share of such changes from which on there is noise."""
SCATTERED, TO_AND_FRO = 0.7, 0.5
"""Share of unrounded readings that differ from the one before, and of their changes that turn back, of noise."""
ALL_NOISE = 12.0
"""Times the noise that positions may span where it is all there is."""


@dataclass(frozen=True, slots=True)
class _Windows:
    """Windows of one width, about their mean or line, by scatter."""

    left: Array
    """(windows, w), m."""
    scatter: Array
    """(windows,), m, ascending."""
    drive: Array | None
    """(windows, w + LATEST), or what there is, beginning that much earlier."""
    freedom: int
    """Degrees of freedom of a window."""
    share: float
    """Part of a window's samples that no window before it holds."""

    @property
    def limit(self) -> float:
        """c_k: what 99.5 % of the scatters of noise of 1 stay below."""
        return self.quantile(NORMAL_995)

    def quantile(self, normal: float) -> float:
        """Return the quantile of the scatters of noise of 1 where a normal variable has its own (Wilson, Hilferty)."""
        third = 2.0 / (9.0 * self.freedom)
        return float((1.0 - third + normal * sqrt(third)) ** 1.5)


class _Told(NamedTuple):
    """σ, m, by windows of one width, and the share of them that tell it; mixed: of two noises, and that of neither."""

    noise_m: float
    share: float
    mixed: bool = False


def noise_by_median(differences: Array) -> Array:
    """Return σ (...), in the unit of the position, by the median of the last axis of third differences (..., n)."""
    ordered, half = np.sort(np.abs(differences), axis=-1), differences.shape[-1] // 2  # a tenth of np.median's time
    median = (ordered[..., half] + ordered[..., -1 - half]) / 2.0
    return np.asarray(median / (MEDIAN_OF_NORMAL * VARIANCE**0.5))


def position_noise_m(position_m: Array, drive_pa: Array | None = None) -> float | None:
    """Return by what a reading is off, rms, m, rounding included; None where the samples do not tell.

    Args:
        position_m: (N,), about evenly sampled; NaN counts as missing.
        drive_pa: what moves the stem, (N,): the command or the actuator pressure; a stem that follows it moves.

    >>> rng = np.random.default_rng(0)
    >>> steps_m = np.repeat(rng.uniform(0.0, 0.1, 80), 5)
    >>> f"{position_noise_m(steps_m + rng.normal(0.0, 5e-5, 400)):.0e}"
    '5e-05'
    >>> position_noise_m(0.05 + 0.03 * np.sin(np.arange(400.0))) is None
    True
    """
    quantum = quantum_m(position_m)
    back_m = held_back_m(position_m, quantum)
    position_m = np.where(frozen(position_m, quantum), np.nan, position_m)
    level = _rests(position_m, quantum)
    if quantum:
        position_m = position_m + quantum * np.random.default_rng(0).uniform(-0.5, 0.5, position_m.size)
    told = [_of_width(position_m, drive_pa, width) for width in WIDTHS]
    # Where a long window rests so do the shorter ones in it.
    longest = next((i + 1 for i in range(WIDTHS.index(STRAIGHT), -1, -1) if told[i] is None), 0)
    finest_m = HARDLY * float(np.nanmax(position_m) - np.nanmin(position_m)) if np.isfinite(position_m).any() else 0.0
    found = [each for each in told[longest:] if each and not each.mixed]
    # Few windows without any noise are lines between two samples, or a value that was repeated.
    found = [each for each in found if each.noise_m >= finest_m or each.share >= MANY_WITHOUT]
    if not found:
        return None
    # Motion only adds: what another width finds far above the least is motion that looks like noise.
    least_m = min(each.noise_m for each in found)
    found = [each for each in found if each.noise_m <= ALIKE_NOISE_FACTOR * least_m]
    most = max(each.share for each in found)
    noise_m = next(each.noise_m for each in found if each.share >= AS_MANY * most)
    if noise_m == 0.0 and np.unique(position_m[np.isfinite(position_m)]).size <= FEW_STEPS:
        return None  # a stem that hardly moves, in numbers that are rounded who knows how
    if drive_pa is None and np.nanmax(position_m) - np.nanmin(position_m) < ALL_NOISE * noise_m:
        return None  # noise, or a stem that goes elsewhere from sample to sample: the drive would tell
    whole_m = _with_rounding(noise_m, quantum) if quantum else noise_m
    if whole_m < back_m:
        return None
    level |= any(each is not None for each, width in zip(told, WIDTHS, strict=True) if width < STRAIGHT)
    if whole_m < max(ROUNDING_ALONE * quantum / 12.0**0.5, finest_m) and not level:
        return None
    return None if drive_pa is not None and _scatters_more(position_m, drive_pa, whole_m, quantum) else whole_m


def quantum_m(position_m: Array) -> float:
    """Return the step to which positions, (N,), m, are rounded, in m; 0 if they are not. NaN counts as missing.

    >>> f"{quantum_m(np.round(np.linspace(0.0, 0.01, 500) / 25e-6) * 25e-6):.3g}"
    '2.5e-05'
    """
    finite_m = position_m[np.isfinite(position_m)]
    levels = np.unique(finite_m)
    steps = np.diff(levels)
    # Levels a rounding error apart are one level.
    steps = steps[steps > 1e-9 * float(np.ptp(levels))] if steps.size else steps
    if steps.size < FEW_STEPS:
        # Of a stem at rest a few levels show the quantum, if it flickers between them.
        flickers = np.count_nonzero(np.diff(finite_m)) > 2 * steps.size
        return float(steps.min()) if steps.size and flickers else 0.0
    smallest = float(np.median(steps[steps < 1.5 * float(steps.min())]))
    enough = max(FEW_STEPS, min(0.1 * steps.size, MANY_STEPS))
    grids = (_grid(steps, smallest / divisor, enough) for divisor in DIVISORS)
    return next((quantum for quantum in grids if quantum), 0.0)


def held_back_m(position_m: Array, quantum: float) -> float:
    """Return by how much positions, (n,), m, rounded to a quantum, m, change at least; 0 if by one or two of it.

    A tenth of the changes may be smaller: a historian keeps a value now and then because it is old. Quantum 0: they are
    not rounded, and a small part of what they span stands for it.

    >>> rng = np.random.default_rng(0)
    >>> rests_m = np.round(np.repeat(rng.uniform(0.0, 0.1, 80), 5) / 25e-6) * 25e-6
    >>> held_back_m(rests_m, 25e-6) > 0.0, held_back_m(rests_m + 25e-6 * rng.integers(0, 2, 400), 25e-6)
    (True, 0.0)
    """
    finite_m = position_m[np.isfinite(position_m)]
    changes = np.abs(np.diff(finite_m))
    if changes.size < FEWEST_CHANGES:
        return 0.0
    least = quantum or HARDLY * float(np.ptp(finite_m))
    alike = changes <= 0.5 * least
    changes = changes[~alike]
    if changes.size < FEWEST_CHANGES or (not quantum and np.mean(alike) < REPEATED):
        return 0.0
    least_m = float(np.quantile(changes, RARELY))
    return least_m if least_m > HELD_BACK * least else 0.0


def frozen(position_m: Array, quantum: float) -> Mask:
    """Return in which samples, (n,), a reading, m, rounded to a quantum or, 0, not, stands still as no noise lets it.

    The first of a run is a reading as any other. Where that would be half of the samples and more, or at the ends of
    the range, where a transmitter is limited, none is.

    >>> rng = np.random.default_rng(0)
    >>> position_m = 0.05 + rng.normal(0.0, 5e-5, 400)
    >>> position_m[100:140] = position_m[100]
    >>> int(frozen(position_m, 0.0).sum())
    39
    """
    found = np.zeros(position_m.size, np.bool_)
    count = int(np.isfinite(position_m).sum())
    changes = np.diff(position_m)
    alike = np.abs(changes) <= 0.5 * quantum
    longest = _longest_by_chance(changes[np.isfinite(changes)], quantum)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], alike, [False]])))
    ends_m = (np.nanmin(position_m), np.nanmax(position_m)) if count else ()
    for first, last in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if last + 1 - first >= longest and position_m[first] not in ends_m:
            found[first + 1 : last + 1] = True
    return found if np.count_nonzero(found) < 0.5 * count else np.zeros_like(found)


def _rests(position_m: Array, quantum: float) -> bool:
    """Return whether positions, (n,), m, often are within a quantum, m, for as long as a line is told from a rest."""
    if position_m.size < STRAIGHT:
        return False
    windows = sliding_window_view(position_m, STRAIGHT)
    windows = windows[np.isfinite(windows).all(axis=1)]
    return windows.size > 0 and bool(np.mean(np.ptp(windows, axis=1) <= 1.5 * quantum) >= LEAST_LEVEL)


def _longest_by_chance(changes: Array, quantum: float) -> float:
    """Return how many like readings may follow one another, by how readings change from one to the next, (n,), m.

    Noise turns back at once, a move seldom.
    """
    moved = changes[np.abs(changes) > 0.5 * quantum]
    back = np.abs(changes[1:][changes[1:] * changes[:-1] < 0.0])
    if not quantum:
        scatters = moved.size > SCATTERED * changes.size and back.size > TO_AND_FRO * moved.size
        return FEWEST_FROZEN if scatters else np.inf
    noise = np.count_nonzero((back > 1.5 * quantum) & (back <= NEAR_QUANTA * quantum))
    if noise < LEAST_NOISY * changes.size or not noise:
        return np.inf
    likely = _alike(noise / changes.size)
    return max(FEWEST_FROZEN, log(FROZEN_BY_CHANCE / changes.size) / log(likely))


def _alike(share: float) -> float:
    """Return p of the least noise, in quanta, that changes a reading by two and more in such a share of pairs."""
    edges = np.arange(0.5, 60.0)
    low, high = 0.1, 10.0
    for _ in range(30):
        noise = sqrt(low * high)
        inside = np.array([erf(each / (sqrt(2.0) * noise)) for each in edges.tolist()])
        levels = np.diff(inside) / 2.0
        levels = np.concatenate([levels[::-1], inside[:1], levels])
        apart = 1.0 - float(levels @ levels + 2.0 * (levels[1:] @ levels[:-1]))
        low, high = (noise, high) if apart < share else (low, noise)
    return float(inside[0])


def _grid(steps: Array, quantum: float, enough: float) -> float:
    """Return a quantum, refined, if enough of the steps between levels are its multiples; else 0.

    The long ones must be, too: near where a smooth motion turns, levels lie 1, 3, 5, ... times something apart.
    """
    for reach in REACHES:
        part = steps[steps < reach * quantum]
        multiples = np.round(part / quantum)
        # Numbers written with few digits are off the grid themselves.
        quantum = float(part @ multiples / (multiples @ multiples))
        if np.mean(np.abs(part - quantum * multiples) < ON_GRID * quantum) <= 0.95:
            return 0.0
    return quantum if part.size >= enough else 0.0


def _of_width(position_m: Array, drive_pa: Array | None, width: int) -> _Told | None:
    """Return what windows of one width tell; None where they tell nothing."""
    windows = _windows(position_m, drive_pa, width)
    if windows is None:
        return None
    s, limit = windows.scatter, windows.limit
    rms = np.sqrt(np.cumsum(s**2) / np.arange(1, s.size + 1))
    each = windows.freedom * windows.share
    fewest = max(int(FEWEST_DEGREES_OF_FREEDOM / each), int(LEAST_SHARE * s.size), FEWEST_WINDOWS - 1) + 1
    if s.size < fewest:
        return None
    least, most = float(s[fewest - 1]), float(s[-1])
    if least == 0.0:
        return _Told(0.0, float(np.mean(s == 0.0)))
    scales = least / limit * NEXT ** np.arange(int(log(most / least) / log(NEXT)) + 2 + int(log(limit) / log(NEXT)))
    counts = np.searchsorted(s, limit * scales, side="right")
    found_m = rms[counts - 1]
    itself = (counts >= fewest) & (found_m <= scales)
    quiet, loud = _ends(windows, found_m, counts)
    ends = itself & ~quiet & ~loud & (windows.share * counts >= ENOUGH_FOR_ENDS) & (width >= STRAIGHT)
    ended = itself & (rms[np.searchsorted(s, GAP * limit * scales, side="right") - 1] <= GROWS * found_m)
    for passing in (ends | (ended & ~quiet), ended):
        if passing.any():
            first = int(passing.argmax())
            count = int(np.searchsorted(s, (BEYOND if ended[first] else 1.0) * limit * scales[first], side="right"))
            noise_m = float(rms[count - 1])
            if _is_white(windows.left[:count], noise_m, each) and not _follows(windows, count, each):
                return _Told(noise_m, count / s.size, bool(quiet[first]))
    return None


def _ends(windows: _Windows, noise_m: Array, counts: npt.NDArray[np.intp]) -> tuple[Mask, Mask]:
    """Return whether too many of the first windows, as many as counts, scatter too little, or too much, for a noise."""
    s = windows.scatter
    most = MOST_OF_TENTH + 3.0 * np.sqrt(TENTH * (1.0 - TENTH) / np.maximum(windows.share * counts, 1.0))
    below = np.searchsorted(s, windows.quantile(NORMAL_10) * noise_m)
    above = counts - np.searchsorted(s, windows.quantile(NORMAL_90) * noise_m)
    return below > most * counts, above > most * counts


def _windows(position_m: Array, drive_pa: Array | None, width: int) -> _Windows | None:
    if position_m.size < width:
        return None
    straight = width >= STRAIGHT
    stride = width // 2 if straight else 1
    left = sliding_window_view(position_m, width)[::stride]
    rows = np.flatnonzero(np.isfinite(left).all(axis=1))
    if not rows.size:
        return None
    left = left[rows] - left[rows].mean(axis=1, keepdims=True)
    if straight:
        line = np.arange(width) - 0.5 * (width - 1)
        line /= np.linalg.norm(line)
        left = left - np.outer(left @ line, line)
    freedom = width - 2 if straight else width - 1
    scatter = np.sqrt(np.sum(left**2, axis=1) / freedom)
    order = np.argsort(scatter, kind="stable")
    drive = None
    if drive_pa is not None:
        earlier = np.concatenate([np.full(LATEST_FOLLOWING_SAMPLES, drive_pa[0]), drive_pa])
        drive = sliding_window_view(earlier, width + LATEST_FOLLOWING_SAMPLES)[::stride][rows][order]
    return _Windows(left[order], scatter[order], drive, freedom, stride / width)


def _is_white(left: Array, noise_m: float, freedom: float) -> bool:
    """Return whether first and second differences scatter as the samples themselves do."""
    count = sqrt(freedom * len(left))
    first = float(np.mean(np.diff(left, axis=1) ** 2)) / (2.0 * noise_m**2)
    second = float(np.mean(np.diff(left, 2, axis=1) ** 2)) / (6.0 * noise_m**2)
    return abs(first - 1.0) < WHITE + 2.0 / count and abs(second - 1.0) < WHITE + 3.0 / count


def _follows(windows: _Windows, count: int, freedom: float) -> bool:
    """Return whether what is left in the first windows goes with the drive, at once or some samples later."""
    if windows.drive is None:
        return False
    left, width = windows.left[:count], windows.left.shape[1]
    drive = windows.drive[:count]
    for late in range(LATEST_FOLLOWING_SAMPLES + 1):
        u = drive[:, LATEST_FOLLOWING_SAMPLES - late : LATEST_FOLLOWING_SAMPLES - late + width]
        u = u - u.mean(axis=1, keepdims=True)
        power = float(np.sum(u**2) * np.sum(left**2))
        # A controller that answers the noise makes the drive go against the position.
        most = max(FOLLOWS, min(FOLLOWS_OF_FEW, 4.0 / sqrt(freedom * count)))
        if power > 0.0 and float(np.sum(u * left)) > most * sqrt(power):
            return True
    return False


def _scatters_more(position_m: Array, drive_pa: Array, noise_m: float, quantum: float) -> bool:
    """Return whether a stem scatters by more than a noise, m, where its drive has long been held."""
    for width in HELD_WIDTHS:
        left = _held(position_m, drive_pa, width)
        if len(left) < FEWEST_WINDOWS:
            continue
        slow, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, width), PARABOLA))
        left = left - (left @ slow) @ slow.T
        squares = np.sum(left**2, axis=1) / (width - PARABOLA)
        squares = squares[squares <= STILL**2 * np.quantile(squares, RESTS)]
        scatter_m = float(np.mean(squares)) ** 0.5
        whole_m = _with_rounding(scatter_m, quantum) if quantum else scatter_m
        # Windows begin half a one after another: so many are half as many.
        chance = 3.0 / sqrt(squares.size * (width - PARABOLA))
        return whole_m > (1.0 + WHITE + chance) * noise_m
    return False


def _held(position_m: Array, drive_pa: Array, width: int) -> Array:
    """Return the windows before which the drive was held for some more already, (windows, width)."""
    length = HELD_FOR * width
    if position_m.size < length:
        return np.empty((0, width))
    drive = sliding_window_view(drive_pa, length)[:: width // 2]
    last = sliding_window_view(position_m, length)[:: width // 2][:, -width:]
    return np.asarray(last[(np.ptp(drive, axis=1) == 0.0) & np.isfinite(last).all(axis=1)])


def _with_rounding(scatter_m: float, quantum: float) -> float:
    """Return sqrt(σ_w^2 + q^2/12) of the scatter of rests under an even noise of q besides."""
    seen_m2 = max(scatter_m**2 - quantum**2 / 12.0, 0.0)
    low_m, high_m = 0.0, scatter_m + quantum
    for _ in range(50):
        white_m = 0.5 * (low_m + high_m)
        hidden = np.sum(np.exp(-((2.0 * pi * HARMONICS * white_m / quantum) ** 2)) / HARMONICS**2) / (2.0 * pi**2)
        if white_m**2 + quantum**2 * (1.0 / 12.0 - float(hidden)) < seen_m2:
            low_m = white_m
        else:
            high_m = white_m
    return sqrt(low_m**2 + quantum**2 / 12.0)

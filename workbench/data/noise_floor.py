"""What no model can explain: the sensor's noise, its rounding, and how well the valve repeats itself.

The noise is found at rest (`signals.noise`), never in motion. A record whose command repeats after a lag L shows the
position twice: repeatability = rms(x(t + L) - x(t)) / sqrt 2; and where nothing rests, what rests in the difference of
the two tells the noise. What repeats is no noise, but for the last rounding, q: noise^2 <= repeatability^2 + q^2 / 12.

Friction that has changed in the meantime is no scatter either: it moves every rest by as much, against the direction s
of the slide that ended there. Of the difference d = x(t + L) - x(t), at m rests, that part is taken out,

    c = mean of s d,    r = d - c s        where F = (m - 1) (sum d^2 - sum r^2) / sum r^2 has p < 1e-4

with F of 1 and m - 1 degrees of freedom; on the way from rest to rest it is anything up to that, |d - r| <= |c|. Then
repeatability^2 = m / (m - 1) mean r^2 / 2.

Where nothing tells it, it is what the recording says of itself (`# noise_m: 5e-5`, or the option `--noise-m`), or it is
unknown.
"""

from dataclasses import replace

import numpy as np

from config.drive import Scale
from config.errors import InputError
from config.recording import Column, Recording
from signals.moves import directions
from signals.noise import position_noise_m

NOISE = "noise_m"
"""Key under which a recording says its noise."""
REPEATS = 1e-3
"""A command repeats if its rms difference over the lag is below this part of its rms deviation."""
AGREED, LAP_DEVIATIONS = 10, 4.0
"""Samples, and deviations of the noise, in which two laps are seen to agree."""
BY_CHANCE = 1e-4
"""Chance of what laps have in common in direction of motion, below which it is a change of friction and no scatter."""
UNKNOWN = (
    "the noise of the sensor is unknown, so that no verdict rests on it: the stem rests nowhere long enough, or "
    "to the last digit, or goes along straight lines, as a historian draws them, and no command repeats. Say it, "
    "--noise-m M, or record the stem at rest, the command held for 40 samples, every reading as it was measured"
)


def say_m(value_m: float | None, length: Scale) -> str:
    """Say a noise or a floor, in the unit in which lengths are read."""
    return "unknown" if value_m is None else length.said(value_m, ".4g")


def with_noise(recording: Recording, noise_m: float | None) -> Recording:
    """Return a recording that says its noise, the standard deviation in m, rounding included; None: as it is.

    Raises:
        InputError: it is not positive.
    """
    if noise_m is None:
        return recording
    if not 0.0 < noise_m < np.inf:
        raise InputError(NOISE, f"must be positive, it is {noise_m:g}")
    return replace(recording, metadata={**recording.metadata, NOISE: repr(float(noise_m))})


def said_noise_m(recording: Recording) -> float | None:
    """Return the noise that a recording says it has, m; None if it says nothing.

    Raises:
        InputError: what it says is no positive number.
    """
    said = recording.metadata.get(NOISE)
    if said is None:
        return None
    try:
        noise_m = float(said)
    except ValueError:
        noise_m = np.nan
    if not 0.0 < noise_m < np.inf:
        raise InputError("recording", f"{NOISE}: {said}; it must be a positive number, m")
    return noise_m


def noise_std_m(position_m: Column, command_pa: Column) -> float | None:
    """Return the standard deviation of the noise in m, rounding included; None where the samples do not tell.

    Args:
        position_m: m, (n,), evenly sampled or nearly so, NaN where it is missing.
        command_pa: Pa, (n,).
    """
    noise_m = position_noise_m(position_m, command_pa)
    if noise_m is None and (lag := repeat_lag(command_pa)):
        return position_noise_m((position_m[lag:] - position_m[:-lag]) / 2.0**0.5, command_pa[lag:])
    return noise_m


def not_repeating_m(noise_m: float | None, repeated_m: float | None, rounded_to_m: float) -> float | None:
    """Return the noise, m, no more than what does not repeat itself allows.

    Args:
        noise_m: as found, m; None: unknown.
        repeated_m: the repeatability, m; None: no command repeats.
        rounded_to_m: step of the readings, m; rounding hides from a repetition, and is what a reading is off by.
    """
    if noise_m is None or repeated_m is None:
        return noise_m
    return min(noise_m, float(np.hypot(repeated_m, rounded_to_m / 12.0**0.5)))


def repeat_lag(command_pa: Column) -> int | None:
    """Return the shortest lag, in samples, after which the evenly sampled command repeats itself; None if it does not.

    At least a third of the lag must be there twice, and the command must change within it.
    """
    n = command_pa.size
    u = command_pa - command_pa.mean()
    power = float(np.mean(u**2))
    if n < 60 or np.ptp(command_pa) == 0.0:
        return None
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(u, size)
    products = np.fft.irfft(np.abs(spectrum) ** 2, size)[:n]
    total = np.concatenate([[0.0], np.cumsum(u**2)])
    lags = np.arange(n)
    difference = (total[n - lags] + total[n] - total[lags] - 2.0 * products) / (n - lags)
    allowed = (lags >= 20) & (n - lags >= np.maximum(20, lags // 3)) & (difference < REPEATS**2 * power)
    # A held command repeats itself after any lag: it must have moved in the meantime.
    before, after = _ranges(u), _ranges(u[::-1])[::-1]
    allowed[1:] &= (np.minimum(before[:-1], after[1:]) > power**0.5) & (difference[lags[1:] // 2] > 0.01 * power)
    found = np.flatnonzero(allowed)
    return int(found[0]) if found.size else None


def _ranges(x: Column) -> Column:
    """Return greatest less least of all up to each, as x, (n,)."""
    return np.maximum.accumulate(x) - np.minimum.accumulate(x)


def repeatability_m(command_pa: Column, position_m: Column) -> float | None:
    """Return the repeatability in m of an evenly sampled stretch, None if its command does not repeat itself.

    A first lap of three or more is left out: it begins elsewhere. Of two, what comes before they first agree, or rest
    after a move that both made: until then they differ by where they began, and not by what the valve does not repeat.
    """
    lag = repeat_lag(command_pa)
    if lag is None:
        return None
    noise_m = noise_std_m(position_m, command_pa)
    first = lag if position_m.size > 2.5 * lag else 0
    before_m, after_m = position_m[first:-lag], position_m[first + lag :]
    agreed = 0 if first or noise_m is None else _agreed(before_m, after_m, noise_m)
    before_m, after_m = before_m[agreed:], after_m[agreed:]
    finite = np.isfinite(after_m - before_m)
    if not finite.any():
        return None
    return _scatter_m(before_m[finite], after_m[finite], noise_m)


def _scatter_m(before_m: Column, after_m: Column, noise_m: float | None) -> float:
    """Return the scatter of two laps, m, without a change of friction between them, where that is beyond chance."""
    difference_m = after_m - before_m
    scatter_m = float(np.sqrt(np.mean(difference_m**2) / 2.0))
    if noise_m is None:
        return scatter_m
    way = directions(0.5 * (before_m + after_m), noise_m)
    rests = int(np.count_nonzero((way[:-1] != 0) & (way[1:] == 0)))
    if rests < 2:
        return scatter_m
    moves = int(np.argmax(way != 0))
    way, difference_m = way[moves:], difference_m[moves:]
    ended = way[np.maximum.accumulate(np.where(way != 0, np.arange(way.size), 0))]
    at_rest = way == 0
    shift_m = float(np.mean((ended * difference_m)[at_rest]))
    on_the_way_m = np.clip(difference_m, -abs(shift_m), abs(shift_m))
    left_m = difference_m - np.where(at_rest, shift_m * ended, on_the_way_m)
    if not _is_beyond_chance(difference_m[at_rest], left_m[at_rest], rests):
        return scatter_m
    return float(np.sqrt(np.mean(left_m**2) / 2.0 * rests / (rests - 1)))


def _is_beyond_chance(whole_m: Column, left_m: Column, count: int) -> bool:
    """Whether so many differences, of which one common part was taken out, left so little that it was there."""
    from scipy.special import fdtrc

    whole, left = float(np.sum(whole_m**2)), float(np.sum(left_m**2))
    ratio = (count - 1) * (whole - left) / max(left, np.finfo(float).tiny)
    return bool(fdtrc(1, count - 1, ratio) < BY_CHANCE)


def _agreed(before_m: Column, after_m: Column, noise_m: float) -> int:
    """Return from where on two laps have agreed, or rested after a move of both; 0 if they never do."""
    near = np.abs(after_m - before_m) <= LAP_DEVIATIONS * 2.0**0.5 * noise_m
    together = np.convolve(near, np.ones(AGREED), "valid") == AGREED
    agreed = int(np.argmax(together)) if together.size else 0
    moving = np.array([directions(each, noise_m) != 0 for each in (before_m, after_m)])
    rested = np.logical_or.accumulate(moving.all(axis=0)) & ~moving.any(axis=0)
    landed = int(np.argmax(rested))
    return min(agreed, landed) if agreed and landed else agreed

"""What no model can explain: the sensor's noise, its rounding, and how well the valve repeats itself.

    sigma = median of the rms of blocks of 16 third differences (`config.noise`), at least q / sqrt 12 for a quantum q

A record whose command repeats after a lag L shows the position twice: repeatability = rms(x(t + L) - x(t)) / sqrt 2.
"""

import numpy as np

from config.noise import noise_by_rms, quantum_m
from config.recording import Column

BLOCK = 16
REPEATS = 1e-3
"""A command repeats if its rms difference over the lag is below this part of its rms deviation."""


def noise_std_m(position_m: Column) -> float:
    """Return the standard deviation of the white noise in m, rounding included; 0 for fewer than 20 samples."""
    third = np.diff(position_m[np.isfinite(position_m)], 3)
    blocks = third[: third.size // BLOCK * BLOCK].reshape(-1, BLOCK)
    if not len(blocks):
        return 0.0
    white = float(np.median(noise_by_rms(blocks)))
    return max(white, quantum_m(position_m) / 12**0.5)


def repeat_lag(command_pa: Column) -> int | None:
    """Return the shortest lag, in samples, after which the evenly sampled command repeats itself; None if it does not.

    At least a third of the lag must be there twice, and the command must change within it.
    """
    n = command_pa.size
    u = command_pa - command_pa.mean()
    power = float(np.mean(u**2))
    if n < 60 or power == 0.0:
        return None
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.fft.rfft(u, size)
    products = np.fft.irfft(np.abs(spectrum) ** 2, size)[:n]
    total = np.concatenate([[0.0], np.cumsum(u**2)])
    lags = np.arange(n)
    difference = (total[n - lags] + total[n] - total[lags] - 2.0 * products) / (n - lags)
    allowed = (lags >= 20) & (n - lags >= np.maximum(20, lags // 3)) & (difference < REPEATS**2 * power)
    for lag in lags[allowed].tolist():
        # A held command repeats itself after any lag: it must have moved in the meantime.
        if np.ptp(u[:lag]) > power**0.5 and np.ptp(u[lag:]) > power**0.5 and difference[lag // 2] > 0.01 * power:
            return int(lag)
    return None


def repeatability_m(command_pa: Column, position_m: Column) -> float | None:
    """Return the repeatability in m of an evenly sampled stretch, None if its command does not repeat itself.

    A first lap of three or more is left out: it begins elsewhere.
    """
    lag = repeat_lag(command_pa)
    if lag is None:
        return None
    first = lag if command_pa.size > 2.5 * lag else 0
    difference = position_m[first + lag :] - position_m[first:-lag]
    finite = difference[np.isfinite(difference)]
    return float(np.sqrt(np.mean(finite**2) / 2.0)) if finite.size else None

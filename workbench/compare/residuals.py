"""The residual, simulated minus measured position, against all that could explain it.

    r_xy(k) = sum_i x_i y_(i+k) / sqrt(sum x^2 sum y^2)                     lags k = 0..25 (residual), -25..25 (input)
    white residual: |r_ee(k)| < 2.58 / sqrt n                               99 % band
    structured share: mean of r_ee(1..5), at least 0        of the residual's power; of white noise 0 +- 1 / sqrt(5 n)
    independent input: |r_ue(k)| < 2.58 sqrt(sum_l r_uu(l) r_ee(l) / n)     99 % band (Bartlett), both with their memory

A residual of a simulation need not be white, but it must not depend on the input.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from config.results.result import Brief

RESIDUAL_LAGS = 25
NOISELESS_LAGS = 5
"""Samples over which what is no noise goes on."""
BAND_99 = 2.576  # deviations of a normal that 99 % lie within
MEMORY = 0.2
"""Part of the record over which correlations are summed for the input's band."""
BINS = 20  # of a profile over position, velocity or pressure
FEWEST_BIN_ROWS = 5  # a bin of fewer has no mean
LONGEST_WINDOW = 1024
"""Samples of a piece of which a spectrum is made."""


@dataclass(frozen=True, slots=True, repr=False)
class Profile(Brief):
    """Mean and its standard error over bins of something; bins with few samples are left out."""

    centre: Column
    mean: Column
    standard_error: Column
    count: NDArray[np.int64]


@dataclass(frozen=True, slots=True, repr=False)
class Correlation(Brief):
    """Correlation by lag, in samples and s, and the half-width of its 99 % band."""

    lag: NDArray[np.int64]
    lag_s: Column
    value: Column
    band: float

    @property
    def outside(self) -> int:
        """Number of lags, 0 of an autocorrelation excepted, outside the band."""
        seen = np.abs(self.value) > self.band
        return int(seen[(self.lag != 0) | (np.abs(self.value) < 1.0 - 1e-12)].sum())

    @property
    def structured_share(self) -> float:
        """Part of the power that goes on from sample to sample, of an autocorrelation of two samples and more."""
        return max(0.0, float(np.mean(self.value[(self.lag >= 1) & (self.lag <= NOISELESS_LAGS)])))


@dataclass(frozen=True, slots=True, repr=False)
class Spectrum(Brief):
    """Power spectral density of the residual, m^2/Hz."""

    frequency_hz: Column
    density_m2_per_hz: Column


def profile(over: Column, values: Column, bins: int = BINS) -> Profile:
    """Return the mean of values, (n,), in even bins of another series, (n,), both finite; empty bins are left out."""
    span = float(np.ptp(over)) if over.size else 0.0
    member = (
        np.minimum(((over - over.min()) / span * bins).astype(np.int64), bins - 1)
        if span
        else np.zeros(over.size, np.int64)
    )
    count = np.bincount(member, minlength=bins)
    kept = np.flatnonzero(count >= FEWEST_BIN_ROWS)
    n = count[kept]
    mean = np.bincount(member, values, bins)[kept] / n
    square = np.bincount(member, values**2, bins)[kept] / n
    deviation = np.sqrt(np.maximum(square - mean**2, 0.0))
    centre = np.bincount(member, over, bins)[kept] / n
    return Profile(centre, mean, deviation / np.sqrt(n), n)


def autocorrelation(residual_m: Column, period_s: float) -> Correlation:
    """Return rho at lags 0 to 25, (26,), of an evenly sampled residual, m, (n,), with the 99 % band (Ljung, 16.6)."""
    rho = _correlate(residual_m, residual_m)
    lag = np.arange(min(RESIDUAL_LAGS + 1, residual_m.size))
    return Correlation(lag, np.asarray(lag * period_s, np.float64), rho[lag], BAND_99 / residual_m.size**0.5)


def cross_correlation(command_pa: Column, residual_m: Column, period_s: float) -> Correlation:
    """Return rho at lags -25 to 25, (51,), of input, Pa, and residual, m, (n,) each; positive: the input leads.

    The band, 99 %, is that of Ljung, System Identification, 16.6.
    """
    n = residual_m.size
    reach = min(RESIDUAL_LAGS, n - 1)
    lag = np.arange(-reach, reach + 1)
    memory = np.arange(1, max(2, int(MEMORY * n)))
    taper = 1.0 - memory / memory.size
    both = _correlate(command_pa, command_pa)[memory] * _correlate(residual_m, residual_m)[memory]
    variance = max(1.0, 1.0 + 2.0 * float(np.sum(taper * both))) / n
    return Correlation(
        lag, np.asarray(lag * period_s, np.float64), _correlate(command_pa, residual_m)[lag], BAND_99 * variance**0.5
    )


def _correlate(first: Column, second: Column) -> Column:
    """Return the correlation by lag; negative lags at the end, as numpy indexes them."""
    a, b = first - first.mean(), second - second.mean()
    size = 1 << (2 * a.size - 1).bit_length()
    power = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    products = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)
    return np.asarray(products / power) if power > 0.0 else np.zeros(size)


def spectrum(residual_m: Column, period_s: float) -> Spectrum:
    """Return Welch's estimate of the density, m^2/Hz, for an evenly sampled residual, m, (n,)."""
    from scipy.signal import welch  # takes as long to load as all else together

    frequency, density = welch(residual_m, 1.0 / period_s, nperseg=min(LONGEST_WINDOW, residual_m.size))
    return Spectrum(frequency, density)

"""The period of a loop and how regular it is, from the zero crossings of the autocorrelation.

    r = mean(distance of crossings) / (3 std(distance))       oscillating where r > 1

Thornhill, Huang and Zhang, J. Process Control 13 (2003) 91. The autocorrelation has the signal's period and less noise.
Where nothing oscillates, the time scale is the period above which six tenths of the power lie.
"""

from dataclasses import dataclass

import numpy as np

from workbench.loops.loop_record import Array
from workbench.loops.loop_thresholds import LIMITS

POWER = 0.6
"""Share of the power at longer periods than the time scale: a little more than half, against drifts."""
MOST_CROSSINGS = 11
"""Of the autocorrelation: ten half periods."""


@dataclass(frozen=True, slots=True)
class Oscillation:
    """What a signal does.

    Attributes:
        period_s: of the oscillation, or the time scale where there is none.
        regularity: r, 1; from 1 on it oscillates.
        cycles: in the record.
    """

    period_s: float
    regularity: float
    cycles: float

    @property
    def regular(self) -> bool:
        """Whether it oscillates."""
        return self.regularity > LIMITS.regular


def find_oscillation(values: Array, period_s: float) -> Oscillation:
    """Return the oscillation of a signal, (n,), sampled each `period_s`."""
    count = values.size
    detrended = without_trend(values)
    if count < 8 or detrended.std() <= 1e-12 * (1.0 + abs(float(values.mean()))):
        return Oscillation(count * period_s, 0.0, 1.0)
    power = np.abs(np.fft.rfft(detrended * np.hanning(count))) ** 2
    power[:3] = 0.0  # what is left of trends
    cumulated = np.cumsum(power)
    scale = count / max(1, int(np.searchsorted(cumulated, POWER * cumulated[-1])))
    lags = _crossings(_autocorrelation(detrended, scale))
    if lags.size >= 4:
        distances = np.diff(lags[:MOST_CROSSINGS])
        regularity = float(distances.mean() / (3.0 * max(float(distances.std()), 0.25)))
        if regularity > LIMITS.regular:
            scale = 2.0 * float(distances.mean())
    else:
        regularity = 0.0
    return Oscillation(scale * period_s, regularity, count / scale)


def without_trend(values: Array) -> Array:
    """Return a signal, (n,), less its straight line."""
    along = np.linspace(-1.0, 1.0, values.size)
    return np.asarray(values - np.polyval(np.polyfit(along, values, 1), along), np.float64)


def _autocorrelation(values: Array, scale: float) -> Array:
    """Return the autocorrelation of what lies between a fifth of the time scale and five of it."""
    count = values.size
    spectrum = np.fft.rfft(values, 2 * count)
    frequency = np.fft.rfftfreq(2 * count)
    spectrum[(frequency * scale < 0.2) | (frequency * scale > 5.0)] = 0.0
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[: count // 2]
    return np.asarray(correlation / max(float(correlation[0]), 1e-300), np.float64)


def _crossings(values: Array) -> Array:
    """Return where a signal crosses zero, in samples and between them."""
    at = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
    return at + values[at] / (values[at] - values[at + 1])

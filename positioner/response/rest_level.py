"""What a stem at rest reads: its level, its noise, and the quantum of its transmitter.

    σ = max(1.4826 median|d - median d| / sqrt 2,   d the differences of neighbours:   white noise
            1.4826 median|r|,                       r what a straight line leaves:     slow noise
            quantum / sqrt 12)                                                          rounding

Medians, so that a few wild samples change nothing. A level is a median over n samples, of standard deviation
1.2533 σ / sqrt n. Not the third differences of `signals.noise`: a rest may have five samples and holds no motion, and
what drifts slowly there widens a level as noise does.
"""

from dataclasses import dataclass
from math import sqrt

import numpy as np

from config.recording import Column

_TO_SIGMA = 1.4826
_OF_MEDIAN = 1.2533
REST_END_SHARE = 0.2
"""The last part of a hold from which the rest is taken."""
REST_SAMPLES = 5
"""Samples that a rest needs."""


@dataclass(frozen=True, slots=True)
class RestLevel:
    """Where a stem rests, m: level, standard deviation of the level and of a sample, and how far it still drifts."""

    level_m: float
    level_std_m: float
    noise_m: float
    drift_m: float


def rest_at_the_end(time_s: Column, position_m: Column, quantum_m: float) -> RestLevel | None:
    """Return where the stem rests in the last part of a hold, (n,), s and m; None with fewer than five samples."""
    late = time_s >= time_s[-1] - REST_END_SHARE * (time_s[-1] - time_s[0])
    count = max(int(late.sum()), REST_SAMPLES)
    if len(position_m) < count:
        return None
    t, x = time_s[-count:], position_m[-count:]
    noise_m = _noise(t, x, quantum_m)
    half = count // 2
    drift_m = float(np.median(x[-half:]) - np.median(x[:half]))
    return RestLevel(float(np.median(x)), _OF_MEDIAN * noise_m / sqrt(count), noise_m, drift_m)


def _noise(t: Column, x: Column, quantum_m: float) -> float:
    steps = np.diff(x)
    white = _TO_SIGMA * float(np.median(np.abs(steps - np.median(steps)))) / sqrt(2)
    straight = np.polynomial.Polynomial.fit(t, x, 1)(t)
    slow = _TO_SIGMA * float(np.median(np.abs(x - straight)))
    return max(white, slow, quantum_m / sqrt(12))

"""How far a model is off where the stem rests: there noise averages out, and only the balance of forces stands.

    e_j     mean over rest j of simulated less measured position, of n_j samples
    b       how far rests are off besides noise and rounding: median_j e_j^2 / (sigma^2 / n_j + q^2 / 12 + b^2) is
            0.455, that of chi^2 with one degree of freedom; a slip missed now and then does not move it
    b^2 <= (1.2)^2 s^2 + (0.4 sigma)^2,    s^2 = floor^2 - (1.1 sigma)^2, at least 0: the valve's own scatter

sigma noise of the sensor, q its quantum. Friction that is smooth where the model's is not (LuGre's) leaves up to 1.5
floors, mostly on the way, and at rest b up to 0.3 sigma. An effect that stands in for another may leave 1.1 floors, and
b of half a sigma and more: every slide ends somewhat elsewhere.
"""

from dataclasses import dataclass

import numpy as np

from config.noise import MEDIAN_OF_NORMAL, quantum_m
from config.recording import Column
from workbench.data.held_out import Part, Split
from workbench.fit.landings import rests

SMOOTH = 0.4
"""Of the noise: as far off may rests be of a valve whose friction is smooth."""
NO_SCATTER, SCATTER_KNOWN_TO = 1.1, 1.2
"""Noises, up to which a floor shows no scatter of the valve; a factor."""
FEWEST = 20
HALVINGS = 50


@dataclass(frozen=True, slots=True)
class RestErrors:
    """How far rests are off besides noise and rounding, and how far they may be, m."""

    off_m: float
    allowed_m: float

    @property
    def beyond(self) -> bool:
        """Whether rests are elsewhere than noise, scatter and a smooth friction would leave them."""
        return self.off_m > self.allowed_m


def rest_errors(split: Split, fitted_m: Column, held_out_m: Column) -> RestErrors | None:
    """Return how far a model is off at rest; None of too few rests, or where noise or floor are unknown.

    Args:
        split: what was fitted and what was held out.
        fitted_m: simulated less measured position of what was fitted, m, (samples,); NaN where it does not count.
        held_out_m: the same of what was held out.
    """
    parts = ((split.train, fitted_m), (split.test, held_out_m))
    noises_m = [part.record.noise_m for part, _ in parts if part.record.noise_m is not None]
    if split.floor_m is None or len(noises_m) < len(parts):
        return None
    means_m, variances = (np.concatenate(each) for each in zip(*(_means(*each) for each in parts), strict=True))
    if means_m.size < FEWEST:
        return None
    noise_m = max(noises_m)
    scatter_m2 = max(0.0, split.floor_m**2 - (NO_SCATTER * noise_m) ** 2)
    allowed_m = float(np.hypot(SCATTER_KNOWN_TO * scatter_m2**0.5, SMOOTH * noise_m))
    return RestErrors(off_m(means_m, variances), allowed_m)


def off_m(means_m: Column, variances: Column) -> float:
    """Return b, m, from the mean errors of rests, m, (rests,), and their variances without it, m^2, (rests,)."""
    least, most = 0.0, float(np.max(means_m**2))
    for _ in range(HALVINGS):
        middle = 0.5 * (least + most)
        if np.median(means_m**2 / (variances + middle)) > MEDIAN_OF_NORMAL**2:
            least = middle
        else:
            most = middle
    return float(least**0.5)


def _means(part: Part, error_m: Column) -> tuple[Column, Column]:
    """Return the mean error of each rest after a slide, m, and the variance that noise and rounding leave it, m^2."""
    record = part.record
    assert record.noise_m is not None
    rounding = quantum_m(record.position_m[record.valid]) ** 2 / 12.0
    landed = [error_m[each.first : each.end] for each in rests(record) if each.direction]
    counted = [each[np.isfinite(each)] for each in landed]
    counted = [each for each in counted if each.size]
    means_m = np.array([float(np.mean(each)) for each in counted])
    return means_m, np.array([record.noise_m**2 / each.size + rounding for each in counted])

"""How far a model is off where the stem rests: there noise averages out, and only the balance of forces stands.

    e_j     mean over rest j of simulated less measured position, of n_j samples
    b       how far rests are off besides noise and rounding: median_j e_j^2 / (sigma^2 / n_j + q^2 / 12 + b^2) is
            0.455, that of chi^2 with one degree of freedom; a slip missed now and then does not move it
    b_s     the same of e_j - f(x_j, s_j), x_j where it rests, s_j direction of the slide that ended there, f a cubic in
            x for each direction, fitted robustly (soft L1); times n / (n - 8), in squares, of n rests
    b_t     the same of e_j - g(t_j, s_j), g a parabola in time for each direction, of what was fitted and of what was
            held out each for itself; times n / (n - 12)

    slides end elsewhere if b > 0.4 sigma and b_s^2 < 0.3 b^2; they wander as time goes if b_t^2 < 0.3 b^2

sigma noise of the sensor, q its quantum. What misses rests by place and direction is a balance of forces that the model
lacks: an effect that stands in for another may leave 1.1 floors of the whole, and yet b of half a sigma and more, of
which place and direction tell four fifths. Friction that is smooth where the model's is not (LuGre's) leaves as much,
and so does a valve that scatters, but by no such law. What misses them as time goes is a zero that drifts, or forces
that change meanwhile.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numpy.polynomial.legendre import legvander
from scipy.optimize import least_squares

from config.noise import MEDIAN_OF_NORMAL, quantum_m
from config.recording import Column
from workbench.data.held_out import Part, Split
from workbench.fit.landings import rests

LEAST_OFF, MOST_SCATTER = 0.4, 0.3
"""Noises; of the square of how far rests are off."""
DEGREE, DEGREE_IN_TIME = 3, 2
FEWEST = 40
"""Rests."""
HALVINGS = 50

Matrix = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class RestErrors:
    """How far rests are off besides noise and rounding, and how far by no law of place and direction, m."""

    off_m: float
    scatter_m: float
    noise_m: float
    unsteady_m: float
    """By no law of time."""

    @property
    def elsewhere(self) -> bool:
        """Whether slides end elsewhere, by place and direction."""
        return self._mostly_told(self.scatter_m)

    @property
    def wander(self) -> bool:
        """Whether slides end elsewhere as time goes."""
        return self._mostly_told(self.unsteady_m)

    def _mostly_told(self, left_m: float) -> bool:
        """Whether what leaves so much, m, tells most of how far rests are off."""
        return self.off_m > LEAST_OFF * self.noise_m and left_m**2 < MOST_SCATTER * self.off_m**2


@dataclass(frozen=True, slots=True)
class Missed:
    """Rests after slides: mean errors, m; the variances that noise and rounding leave them, m^2; places, m; directions;
    times, s; 1 of what was held out, else 0; each (rests,)."""

    means_m: Column
    variances: Column
    places_m: Column
    directions: Column
    times_s: Column
    held_out: Column


def rest_errors(split: Split, fitted_m: Column, held_out_m: Column) -> RestErrors | None:
    """Return how far a model is off at rest; None of too few rests, or where the noise is unknown.

    Args:
        split: what was fitted and what was held out.
        fitted_m: simulated less measured position of what was fitted, m, (samples,); NaN where it does not count.
        held_out_m: the same of what was held out.
    """
    train, test = split.train, split.test
    if train.record.noise_m is None or test.record.noise_m is None:
        return None
    rows = [
        (*row, float(held_out))
        for held_out, (part, error_m) in enumerate(((train, fitted_m), (test, held_out_m)))
        for row in _missed(part, error_m)
    ]
    if len(rows) < FEWEST:
        return None
    missed = Missed(*np.array(rows).T)
    whole_m = off_m(missed.means_m, missed.variances)
    scatter_m, unsteady_m = (_left_m(missed, whole_m, law(missed)) for law in (by_place, by_time))
    return RestErrors(whole_m, scatter_m, max(train.record.noise_m, test.record.noise_m), unsteady_m)


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


def by_place(missed: Missed) -> Matrix:
    """Return the columns of a cubic of where rests are, for each direction, (rests, 8)."""
    return _for_each_direction(missed, _polynomial(missed.places_m, DEGREE))


def by_time(missed: Missed) -> Matrix:
    """Return the columns of a parabola of when rests are, for each direction and part, (rests, 12)."""
    parts = np.zeros((2, missed.times_s.size, DEGREE_IN_TIME + 1))
    for part, rows in zip(parts, (missed.held_out == 0.0, missed.held_out == 1.0), strict=True):
        if rows.any():
            part[rows] = _polynomial(missed.times_s[rows], DEGREE_IN_TIME)
    return _for_each_direction(missed, np.hstack([*parts]))


def _polynomial(z: Column, degree: int) -> Matrix:
    """Return the columns of a polynomial in z, (n, degree + 1)."""
    x = z - 0.5 * (z.max() + z.min())
    return np.asarray(legvander(x / max(float(np.abs(x).max()), np.finfo(float).tiny), degree))


def _for_each_direction(missed: Missed, columns: Matrix) -> Matrix:
    return np.hstack([columns, columns * missed.directions[:, None]])


def told_m(missed: Missed, whole_m: float, columns: Matrix) -> Column:
    """Return how far rests are off by a law of such columns, (rests, k), m, (rests,); of b, m, in all."""
    scale_m = np.sqrt(missed.variances + whole_m**2)
    matrix = columns / scale_m[:, None]

    def left(c: Column) -> Column:
        return np.asarray(matrix @ c - missed.means_m / scale_m)

    return np.asarray(columns @ least_squares(left, np.zeros(columns.shape[1]), loss="soft_l1").x)


def _left_m(missed: Missed, whole_m: float, columns: Matrix) -> float:
    """Return how far rests are off besides what a law of such columns tells, m."""
    count, parameters = columns.shape
    left_m = off_m(missed.means_m - told_m(missed, whole_m, columns), missed.variances)
    return left_m * float((count / (count - parameters)) ** 0.5)


def _missed(part: Part, error_m: Column) -> Iterator[tuple[float, ...]]:
    """Yield the row of `Missed`, but for what was held out, of each rest after a slide in which samples count."""
    record = part.record
    assert record.noise_m is not None
    rounding = quantum_m(record.position_m[record.valid]) ** 2 / 12.0
    for each in rests(record):
        counted_m = error_m[each.first : each.end]
        counted_m = counted_m[np.isfinite(counted_m)]
        if each.direction and counted_m.size:
            variance = record.noise_m**2 / counted_m.size + rounding
            time_s = float(record.time_s[each.first])
            yield float(np.mean(counted_m)), variance, each.position_m, float(each.direction), time_s

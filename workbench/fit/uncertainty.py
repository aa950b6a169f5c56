"""How well the recording determines what was fitted.

    C = kappa (J' W J)^-1        J = dr/dz by central differences, W the weights of the soft-L1 loss
    kappa = mean square residual (at least 1) x (1 + 2 sum rho_k), rho_k the residual's autocorrelation up to its first
            zero: correlated errors count for fewer samples

The interval of a parameter follows the cost itself, out to where it last stays below a rise of 1.92 kappa (95 %): the
parameter is moved alone and along the direction in which the others give way, C_i / C_ii, and from either the others
take one step of Gauss and Newton. It takes in every other search that ended below the rise: a staircase has no other
slope.

Where the valve itself scatters, weighted squares of the residuals above 1.2 in the mean, a slip is wrong as a whole:
slips count, not samples, and of them those that tell. There the interval reaches at least as far as what either side
costs more, on the average, is no more than its own scatter from slip to slip:

    D(w) = (D_+ + D_-) / 2 < t/2 sqrt V(w)        D_+-  rise of the cost with the parameter w above and below its best
    V(w) = sum o_j^2 (1 + 2 sum rho_k)            o_j = (c_j+ - c_j-) / 2 less its mean, c_j the cost of slip j and the
                                                  rest that follows, rho_k their autocorrelation up to its first zero
    t    quantile 97.5 % of Student's, n - 1 degrees of freedom,  n = (sum o_j^2)^2 / sum o_j^4

For a smooth cost D = H w^2 / 2 and o_j = w g_j, g_j the scores, so that w ends at t sqrt V_g / H: the sandwich
estimator (Huber, White) by clusters, with Satterthwaite's degrees of freedom. It takes in where multiple shooting goes
from the minimum, too: that weighs the slips otherwise, and how far apart the two end says how wrong either may be. And
that of static friction takes in the mean of the break-aways (`static_scatter.py`), below which the run's best lies.

The condition number is that of J scaled to unit columns; a combination is not determined if its standard
deviation exceeds 1, a factor of e.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from math import exp

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from sim.karnopp import Vector
from workbench.data.motion import slips
from workbench.fit.descent import COARSE, descended
from workbench.fit.guesses import with_other_end_kept
from workbench.fit.objective import FINAL, SimulationError, root_weights, softs
from workbench.fit.static_scatter import static_within

DIFFERENCE = 1e-3
SCATTER_DIFFERENCE = 1e-2
"""Where the valve scatters: the narrower one sees single stairs."""
SCATTERS = 1.2
"""Mean of the weighted squared residuals from which the valve is said to scatter: no sensor's noise explains them."""
RISE_95 = 1.92
PROBABILITY = 0.975
FEWEST_FREE = 2.0
"""Degrees of freedom of Student's t at least."""
FARTHEST = 8.0
"""Of a log-parameter: an interval is not followed farther, and open there."""
FAR = 1.0
"""The same: others give way by no more, and a standard deviation counts no more of an interval."""
HALVINGS, SCATTER_HALVINGS = 5, 3
"""By which the end of an interval is found; what scatters is not worth more."""
GIVEN_UP = 3
"""Doublings above the limit after which the cost is taken to stay there."""
INVOLVED = 0.3
"""Component of a unit vector from which a parameter is named as part of a combination."""
NOTHING = 1e-30
"""Of the largest eigenvalue: an information that is none."""
TOLD = 0.1
"""Change of a log-parameter by which a combination is told."""
ILL = 1e4
"""Condition number from which the worst combination is told even if its deviation is below 1."""


@dataclass(frozen=True, slots=True)
class Combination:
    """What may change unseen: parameters, and the power with which each goes, 1 for the one that goes farthest.

    Where the first is multiplied by f the others are by f^power, an effect's parameter that may be zero only in
    proportion to its scale.
    """

    names: tuple[str, ...]
    powers: tuple[float, ...]

    def sentence(self, words: Callable[[str], str] = str) -> str:
        """Say so, a parameter's name in these words."""
        if len(self.names) == 1:
            return f"{words(self.names[0])} is not determined by this recording"
        together = ", ".join(
            f"{words(name)} by {exp(TOLD * power):.3f}" for name, power in zip(self.names, self.powers, strict=True)
        )
        return f"only a combination is determined: these may change together unseen: {together}"


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Standard deviations and 95 % intervals of the coordinates, in their order; the condition and what is open."""

    std: Vector
    lower: Vector
    upper: Vector
    condition: float
    undetermined: tuple[Combination, ...]
    rise: float
    """Rise of the cost that counts as significant, 1.92 kappa."""


def uncertainty(
    error: SimulationError, z: Vector, others: Sequence[Vector] = (), *, profile: bool = True
) -> Uncertainty:
    """Judge a minimum, `others` being where other searches ended; without `profile` by the derivatives alone."""
    residuals = error.residuals(z)
    weights = root_weights(residuals, FINAL)
    kappa = _kappa(residuals)
    scatters = _squares(residuals) > SCATTERS
    J = _central(error, z, SCATTER_DIFFERENCE if scatters else DIFFERENCE) * weights[:, None]
    gram = J.T @ J
    covariance = np.asarray(kappa * np.linalg.pinv(gram, rcond=1e-14, hermitian=True), np.float64)
    lengths = np.linalg.norm(J, axis=0)
    sensitive = lengths > 0.0
    scaled = J / np.where(sensitive, lengths, 1.0)
    values, vectors = np.linalg.eigh(gram)
    std = np.sqrt(np.diag(covariance))
    std[~sensitive] = np.inf
    rise = RISE_95 * kappa
    limit = error.cost(z) + rise
    lower, upper = z - 1.96 * std, z + 1.96 * std
    if profile:
        curve = _Curve(error, z, J, weights, covariance, limit, scatters)
        lower, upper = np.array([curve.interval(i, float(std[i])) for i in range(z.size)]).T
    as_good = np.array([z, *(each for each in others if error.cost(each) < limit)])
    if profile and scatters and not error.run.by.slow:
        as_good = np.vstack([as_good, descended(error.by_slips(), z, COARSE), *static_within(error, z)])
    lower, upper = np.minimum(lower, as_good.min(axis=0)), np.maximum(upper, as_good.max(axis=0))
    condition = float(np.linalg.cond(scaled)) if sensitive.all() else np.inf
    along = np.sqrt(_variances(values, kappa))
    undetermined = tuple(
        _combination(error, vectors[:, i]) for i in range(z.size) if along[i] > 1.0 or (condition > ILL and i == 0)
    )
    std = np.maximum(std, 0.5 * (np.minimum(upper, z + FAR) - np.maximum(lower, z - FAR)) / 1.96)
    lower, upper = np.where(z - lower < FARTHEST, lower, -np.inf), np.where(upper - z < FARTHEST, upper, np.inf)
    return Uncertainty(std, lower, upper, condition, undetermined, rise)


def information(error: SimulationError, z: Vector) -> tuple[Vector, NDArray[np.float64], float]:
    """Return the eigenvalues, (n,), and eigenvectors, (n, n) by columns, of J' W J at z, and kappa."""
    residuals = error.residuals(z)
    J = _central(error, z) * root_weights(residuals, FINAL)[:, None]
    values, vectors = np.linalg.eigh(J.T @ J)
    return values, vectors, _kappa(residuals)


def deviations(error: SimulationError, z: Vector) -> Vector:
    """Return s at z, (parameters,): s_i^2 = sum_k kappa v_ki^2 / lambda_k."""
    return of_coordinates(*along_axes(error, z))


def along_axes(error: SimulationError, z: Vector) -> tuple[Vector, NDArray[np.float64]]:
    """Return the deviations sqrt(kappa / lambda_k) at z along the eigenvectors v_k, (n,), and these, by columns."""
    values, vectors, kappa = information(error, z)
    return np.sqrt(_variances(values, kappa)), vectors


def of_coordinates(along: Vector, vectors: NDArray[np.float64]) -> Vector:
    """Return the deviations of the coordinates, (n,), of those along the eigenvectors."""
    return np.asarray(np.sqrt(vectors**2 @ along**2))


def _variances(values: Vector, kappa: float) -> Vector:
    """Return kappa / lambda_k along each eigenvector of J' W J, of its eigenvalues, (n,), ascending."""
    return np.asarray(kappa / np.maximum(values, NOTHING * max(1.0, float(values[-1]))))


def _kappa(residuals: Vector) -> float:
    return max(1.0, _squares(residuals)) * _correlation(np.clip(residuals, -FINAL, FINAL))


def _squares(residuals: Vector) -> float:
    """Return the mean of the weighted squares."""
    return float(np.mean((root_weights(residuals, FINAL) * residuals) ** 2))


def _central(error: SimulationError, z: Vector, difference: float = DIFFERENCE) -> NDArray[np.float64]:
    columns = []
    for i in range(z.size):
        ahead, behind = z.copy(), z.copy()
        ahead[i] = min(z[i] + difference, error.upper[i])
        behind[i] = max(z[i] - difference, error.lower[i])
        columns.append((error.residuals(ahead) - error.residuals(behind)) / (ahead[i] - behind[i]))
    return np.array(columns).T


def _correlation(values: Vector) -> float:
    """Return 1 + 2 sum rho_k up to the first rho_k that is not positive."""
    away = values - values.mean()
    size = 1 << (2 * away.size - 1).bit_length()
    products = np.fft.irfft(np.abs(np.fft.rfft(away, size)) ** 2, size)[: away.size]
    if products[0] <= 0.0:
        return 1.0
    rho = products[1:] / products[0]
    negative = rho <= 0.0
    return 1.0 + 2.0 * float(rho[: negative.argmax() if negative.any() else rho.size].sum())


@dataclass(frozen=True)
class _Curve:
    """The profile of the cost round a minimum: one coordinate is set, the others give way."""

    error: SimulationError
    z: Vector
    J: NDArray[np.float64]
    """Weighted derivatives at the minimum."""
    weights: Vector
    """Roots of the weights."""
    covariance: NDArray[np.float64]
    limit: float
    scatters: bool

    def interval(self, i: int, std: float) -> tuple[float, float]:
        """Return the ends of the interval in which the profile stays below the limit, or within its scatter."""
        first = min(max(0.5 * std, 1e-6), 0.1)
        below, above = (_reach(partial(self._below, i, way), first, HALVINGS) for way in (-1.0, 1.0))
        if self.scatters and max(below, above) < FARTHEST:
            both = _reach(partial(self._within_scatter, i), max(below, above), SCATTER_HALVINGS)
            below, above = max(below, both), max(above, both)
        return float(self.z[i]) - below, float(self.z[i]) + above

    def _below(self, i: int, way: float, distance: float) -> bool:
        """Whether the cost stays below the limit: moved alone, along the valley, or there with the others refitted."""
        alone, there = self._moved(i, way * distance)
        return any(map(self._is_below, (there, alone))) or any(
            self._is_below(self._given_way(i, each)) for each in (there, alone)
        )

    def _is_below(self, z: Vector) -> bool:
        return self.error.cost_below(z, self.limit) < self.limit

    def _within_scatter(self, i: int, distance: float) -> bool:
        """Whether what it costs to go so far, on the average of both ways, is no more than its scatter allows."""
        above, below = (self._rises(i, way * distance) for way in (1.0, -1.0))
        odd = 0.5 * (above - below)
        squares = (odd - odd.mean()) ** 2
        total = float(squares.sum())
        if total == 0.0:
            return False
        count = total**2 / float(np.sum(squares**2))
        quantile = float(stdtrit(max(count - 1.0, FEWEST_FREE), PROBABILITY))
        rise = 0.5 * float(np.sum(above + below))
        return bool(rise < 0.5 * quantile * (total * _correlation(odd)) ** 0.5)

    def _rises(self, i: int, way: float) -> Vector:
        """Return by how much the cost of each slip rises where the i-th coordinate is moved, the others at best."""
        alone, there = self._moved(i, way)
        places = [alone, there, self._given_way(i, alone), self._given_way(i, there)]
        return np.asarray(self._slip_costs(min(places, key=self.error.cost)) - self._least)

    @cached_property
    def _least(self) -> Vector:
        return self._slip_costs(self.z)

    @cached_property
    def _slips(self) -> NDArray[np.int64]:
        """The slip that each judged sample belongs to, counted from 1; 0 before the first."""
        record = self.error.run.record
        firsts = [
            first + slip.first
            for first, end in record.segments
            for slip in slips(np.where(record.valid, record.position_m, np.nan)[first:end], record.scale_m)
        ]
        return np.searchsorted(firsts, self.error.rows, side="right")

    def _slip_costs(self, z: Vector) -> Vector:
        return np.asarray(np.bincount(self._slips, softs(self.error.residuals(z), FINAL)), np.float64)

    def _moved(self, i: int, way: float) -> tuple[Vector, Vector]:
        """Return the minimum with the i-th coordinate moved alone, and along the valley."""
        alone, there = way * np.eye(self.z.size)[i], way * self._direction(i)
        moved = with_other_end_kept(self.error, self.z, self._clipped(self.z + alone), i)
        return moved, self._clipped(self.z + there)

    def _given_way(self, i: int, z: Vector) -> Vector:
        """Return z after one step of Gauss and Newton by the other coordinates, with the derivatives of the minimum."""
        others = np.arange(z.size) != i
        Q, R = self._reduced
        move = np.zeros(z.size)
        move[others] = np.linalg.lstsq(R[:, others], -Q.T @ (self.weights * self.error.residuals(z)), rcond=1e-10)[0]
        return self._clipped(z + np.clip(move, -FAR, FAR))

    @cached_property
    def _reduced(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """J = Q R: least squares by some columns of R are those by the same of J."""
        Q, R = np.linalg.qr(self.J)
        return Q, R

    def _direction(self, i: int) -> Vector:
        """Return the move of all coordinates per unit of the i-th."""
        own = self.covariance[i, i]
        return np.asarray(self.covariance[i] / own if own > 0.0 else np.eye(self.z.size)[i])

    def _clipped(self, z: Vector) -> Vector:
        return np.clip(z, self.error.lower, self.error.upper)


def _reach(is_inside: Callable[[float], bool], first: float, halvings: int) -> float:
    """Return the farthest distance that is inside, tried from `first` on: a staircase may rise and fall again."""
    near, far, misses, distance = 0.0, first, 0, first
    while distance < FARTHEST and misses < GIVEN_UP:
        if is_inside(distance):
            near, far, misses = distance, 2.0 * distance, 0
        else:
            misses += 1
        distance *= 2.0
    for _ in range(halvings):
        middle = 0.5 * (near + far)
        near, far = (middle, far) if is_inside(middle) else (near, middle)
    return far


def _combination(error: SimulationError, vector: Vector) -> Combination:
    """Return the parameters that lead in a direction of the coordinates, (parameters,)."""
    leading = vector / vector[np.argmax(np.abs(vector))]
    parts = [
        (each.name, float(power))
        for each, power in zip(error.parameters, leading.tolist(), strict=True)
        if abs(power) > INVOLVED
    ]
    return Combination(tuple(name for name, _ in parts), tuple(power for _, power in parts))

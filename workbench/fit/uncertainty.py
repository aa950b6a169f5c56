"""How well the recording determines what was fitted.

    C = kappa (J' W J)^-1        J = dr/dz by central differences, W the weights of the soft-L1 loss
    kappa = mean square residual (at least 1) x (1 + 2 sum rho_k), rho_k the residual's autocorrelation up to its first
            zero: correlated errors count for fewer samples

The interval of a parameter follows the cost itself, out to where it last stays below a rise of 1.92 kappa (95 %): the
parameter is moved alone and along the direction in which the others give way, C_i / C_ii, and from either the others
take one step of Gauss and Newton. It takes in every other search that ended below the rise: a staircase has no other
slope. The condition number is that of J scaled to unit columns; a combination is not determined if its standard
deviation exceeds 1, a factor of e.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import exp

import numpy as np
from numpy.typing import NDArray

from sim.karnopp import Vector
from workbench.fit.objective import FINAL, SimulationError, root_weights

DIFFERENCE = 1e-3
RISE_95 = 1.92
FARTHEST = 1.0
"""Of a log-parameter: an interval is not followed farther."""
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
    J = _central(error, z) * weights[:, None]
    kappa = _kappa(residuals)
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
        curve = _Curve(error, z, J, weights, covariance, limit)
        lower, upper = np.array([curve.interval(i, float(std[i])) for i in range(z.size)]).T
    as_good = np.array([z, *(each for each in others if error.cost(each) < limit)])
    lower, upper = np.minimum(lower, as_good.min(axis=0)), np.maximum(upper, as_good.max(axis=0))
    condition = float(np.linalg.cond(scaled)) if sensitive.all() else np.inf
    along = np.sqrt(_variances(values, kappa))
    undetermined = tuple(
        _combination(error, vectors[:, i]) for i in range(z.size) if along[i] > 1.0 or (condition > ILL and i == 0)
    )
    return Uncertainty(np.maximum(std, 0.5 * (upper - lower) / 1.96), lower, upper, condition, undetermined, rise)


def information(error: SimulationError, z: Vector) -> tuple[Vector, NDArray[np.float64], float]:
    """Return the eigenvalues, (n,), and eigenvectors, (n, n) by columns, of J' W J at z, and kappa."""
    residuals = error.residuals(z)
    J = _central(error, z) * root_weights(residuals, FINAL)[:, None]
    values, vectors = np.linalg.eigh(J.T @ J)
    return values, vectors, _kappa(residuals)


def deviations(error: SimulationError, z: Vector) -> Vector:
    """Return s at z, (parameters,): s_i^2 = sum_k kappa v_ki^2 / lambda_k."""
    values, vectors, kappa = information(error, z)
    return np.asarray(np.sqrt(vectors**2 @ _variances(values, kappa)))


def _variances(values: Vector, kappa: float) -> Vector:
    """Return kappa / lambda_k along each eigenvector of J' W J, of its eigenvalues, (n,), ascending."""
    return np.asarray(kappa / np.maximum(values, NOTHING * max(1.0, float(values[-1]))))


def _kappa(residuals: Vector) -> float:
    squares = (root_weights(residuals, FINAL) * residuals) ** 2
    return max(1.0, float(np.mean(squares))) * _correlation(residuals)


def _central(error: SimulationError, z: Vector) -> NDArray[np.float64]:
    columns = []
    for i in range(z.size):
        ahead, behind = z.copy(), z.copy()
        ahead[i] = min(z[i] + DIFFERENCE, error.upper[i])
        behind[i] = max(z[i] - DIFFERENCE, error.lower[i])
        columns.append((error.residuals(ahead) - error.residuals(behind)) / (ahead[i] - behind[i]))
    return np.array(columns).T


def _correlation(residuals: Vector) -> float:
    """Return 1 + 2 sum rho_k up to the first rho_k that is not positive."""
    clipped = np.clip(residuals, -FINAL, FINAL)
    clipped = clipped - clipped.mean()
    size = 1 << (2 * clipped.size - 1).bit_length()
    products = np.fft.irfft(np.abs(np.fft.rfft(clipped, size)) ** 2, size)[: clipped.size]
    if products[0] <= 0.0:
        return 1.0
    rho = products[1:] / products[0]
    negative = rho <= 0.0
    return 1.0 + 2.0 * float(rho[: negative.argmax() if negative.any() else rho.size].sum())


@dataclass(frozen=True, slots=True)
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

    def interval(self, i: int, std: float) -> tuple[float, float]:
        """Return the ends of the interval in which the profile stays below the limit."""
        first = min(max(0.5 * std, 1e-6), 0.1)
        return float(self.z[i]) - self._reach(i, -1.0, first), float(self.z[i]) + self._reach(i, 1.0, first)

    def _reach(self, i: int, way: float, first: float) -> float:
        """Return the farthest distance at which the cost is below the limit: a staircase may rise and fall again."""
        near, far, misses = 0.0, first, 0
        distance = first
        while distance < FARTHEST and misses < GIVEN_UP:
            if self._below(i, way * distance):
                near, far, misses = distance, 2.0 * distance, 0
            else:
                misses += 1
            distance *= 2.0
        for _ in range(5):
            middle = 0.5 * (near + far)
            near, far = (middle, far) if self._below(i, way * middle) else (near, middle)
        return far

    def _below(self, i: int, way: float) -> bool:
        """Whether the cost stays below the limit: moved alone, along the valley, or there with the others refitted."""
        alone = self._clipped(self.z + way * np.eye(self.z.size)[i])
        there = self._clipped(self.z + way * self._direction(i))
        return any(self.error.cost(each) < self.limit for each in (there, alone)) or any(
            self.error.cost(self._given_way(i, each)) < self.limit for each in (there, alone)
        )

    def _given_way(self, i: int, z: Vector) -> Vector:
        """Return z after one step of Gauss and Newton by the other coordinates, with the derivatives of the minimum."""
        others = np.arange(z.size) != i
        residuals = self.weights * self.error.residuals(z)
        move = np.zeros(z.size)
        move[others] = np.linalg.lstsq(self.J[:, others], -residuals, rcond=1e-10)[0]
        return self._clipped(z + np.clip(move, -FARTHEST, FARTHEST))

    def _direction(self, i: int) -> Vector:
        """Return the move of all coordinates per unit of the i-th."""
        own = self.covariance[i, i]
        return np.asarray(self.covariance[i] / own if own > 0.0 else np.eye(self.z.size)[i])

    def _clipped(self, z: Vector) -> Vector:
        return np.clip(z, self.error.lower, self.error.upper)


def _combination(error: SimulationError, vector: Vector) -> Combination:
    """Return the parameters that lead in a direction of the coordinates, (parameters,)."""
    leading = vector / vector[np.argmax(np.abs(vector))]
    parts = [
        (each.name, float(power))
        for each, power in zip(error.parameters, leading.tolist(), strict=True)
        if abs(power) > INVOLVED
    ]
    return Combination(tuple(name for name, _ in parts), tuple(power for _, power in parts))

"""Standard deviation and validity of what the identifier and the friction means give.

It refuses what is too uncertain; `acceptance` then decides whether the law uses the rest. `batch` has its own checks.

Each estimate f is a function of θ = (a, b, c) with gradient g, and of the filtered means. To first order

    var f = g' cov(θ) g + (share of the filters)^2,    and (g' bias(θ))^2 besides for a, b, c, k singly

With θ's noise correlated as it is, b/c and k/c are known some hundred times better than a, b, c singly, and free of
their bias, which b and c share: along a slow motion the pressure is u = -(b x + k)/c, a straight line whose slope and
intercept those two are.
"""

from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from config.codes import Refusal
from positioner.estimation.array import Array
from positioner.estimation.estimates import Estimate
from positioner.estimation.friction_estimator import Means, friction
from positioner.estimation.weighted_least_squares import Solution

LARGEST_MISFIT = 5.0
"""Beyond this the samples of the window are not those of the model: a sensor that jumped leaves far more ..."""
LEAST_MISFIT = 2e-4
"""... and no less, of the stroke: a smaller misfit moves no estimate that counts."""
LARGEST_NOISE_SHARE = 0.05
"""Beyond this share of noise in P, a, b and c are biased by more than their standard deviation says."""


@dataclass(frozen=True, slots=True)
class ValidityCheck:
    """How uncertain an estimate may be, and the noise of the sensors that makes it so.

    Attributes:
        largest_relative_std: standard deviation allowed, as a share of the value.
        position_noise_m: standard deviation of the white noise of the position.
        pressure_noise_pa: the same of the pressure.
        stroke_m: full travel.
    """

    largest_relative_std: float
    position_noise_m: float
    pressure_noise_pa: float
    stroke_m: float

    def parameters(self, solution: Solution) -> tuple[Estimate, Estimate, Estimate, Estimate]:
        """Return a, b, c and b/c."""
        a, b, c = solution.theta.tolist()
        together = self._refusal_of_all(solution)
        singly = _refusal_of_each(solution) if together is Refusal.VALID else together
        unit = np.eye(3)
        ratio = np.array((0.0, 1 / c, -b / c**2))
        return (
            self._estimate(a, _std(solution, unit[0], biased=True), Refusal.A_POSITIVE if a > 0 else None, singly),
            self._estimate(b, _std(solution, unit[1], biased=True), Refusal.B_NOT_NEGATIVE if b >= 0 else None, singly),
            self._estimate(c, _std(solution, unit[2], biased=True), Refusal.C_NOT_POSITIVE if c <= 0 else None, singly),
            self._estimate(
                b / c, _std(solution, ratio), Refusal.B_OVER_C_NOT_NEGATIVE if b / c >= 0 else None, together
            ),
        )

    def friction(self, solution: Solution, means: Means, direction: int) -> tuple[Estimate, Estimate]:
        """Return k and k/c of a motion in the given direction, +1 or -1."""
        a, b, c = solution.theta.tolist()
        v, x, u = means.velocity_m_per_s, means.position_m, means.pressure_pa
        k = friction(direction, means.acceleration_m_per_s2, v, x, u, solution.theta)
        filters = sqrt(
            (means.filter_noise(a, b) * self.position_noise_m) ** 2 + (c * self.pressure_noise_pa) ** 2 / means.count
        )
        of_k = np.array((-v, -x, -u)) * direction
        of_ratio = np.array((-v, -x, -u - direction * k / c)) * direction / c
        k_std = _std(solution, of_k, filters, biased=True)
        ratio_std = _std(solution, of_ratio, filters / c)
        together = self._refusal_of_all(solution)
        singly = _refusal_of_each(solution) if together is Refusal.VALID else together
        return (
            self._estimate(k, k_std, Refusal.K_NOT_NEGATIVE if k >= 0 else None, singly),
            self._estimate(k / c, ratio_std, Refusal.K_OVER_C_NOT_NEGATIVE if k / c >= 0 else None, together),
        )

    def _refusal_of_all(self, solution: Solution) -> Refusal:
        """Return why not even the ratios may be used."""
        left_m = solution.misfit * self.position_noise_m
        misfits = solution.misfit > LARGEST_MISFIT and left_m > LEAST_MISFIT * self.stroke_m
        return Refusal.MODEL_DOES_NOT_FIT if misfits else Refusal.VALID

    def _estimate(
        self, value: float, std: float, unphysical: Refusal | None, singly: Refusal = Refusal.VALID
    ) -> Estimate:
        if singly is not Refusal.VALID:
            return Estimate(value, std, singly)
        if not std <= self.largest_relative_std * abs(value):
            return Estimate(value, std, Refusal.TOO_UNCERTAIN)
        return Estimate(value, std, Refusal.VALID if unphysical is None else unphysical)


def _refusal_of_each(solution: Solution) -> Refusal:
    """Return why a, b, c and k may not be used singly, although their ratios may."""
    if solution.gaps:
        return Refusal.COMMANDS_MISSED
    return Refusal.NOISE_DOMINATES if solution.noise_share > LARGEST_NOISE_SHARE else Refusal.VALID


def _std(solution: Solution, gradient: Array, filters: float = 0.0, *, biased: bool = False) -> float:
    noise = float(gradient @ solution.covariance @ gradient)
    if not noise >= 0.0:  # θ is so ill known that the rounding of its covariance is more than this variance
        return inf
    bias = float(gradient @ solution.bias) if biased else 0.0
    return sqrt(noise + bias * bias + filters * filters)

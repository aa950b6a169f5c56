"""Maximum likelihood: a, b, c, k and their ratios from one or more motions, as exactly as the samples allow.

The measurement is y_i = x(t_i) + ν_i with white ν of standard deviation σ_x. The most likely parameters make

    S(p) = Σ (y_i - g X_g - q X_q - x_0 X_0 - v_0 X_1)^2        p = (ln τ, ln μ), X(p) as in `stem_response`

least. For given p that is a linear problem; for p, Gauss-Newton with the step damped until S falls. The derivatives
by p are differences. At the minimum the covariance of all parameters is s^2 (J'J)^-1, s^2 = S / (n - parameters): the
Cramér-Rao bound with the noise as measured. a, b, c, k and the ratios follow to first order from their gradients.

Each step has its file: `motion_preparation` makes the rows, `linear_problem` the linear least squares and the
derivatives, `likelihood_search` finds the minimum, and here it becomes a fit with its covariance. An earlier result can
be the prior of the next: the pull of its information is four more rows of the same least squares.
"""

from dataclasses import dataclass

import numpy as np

from config.results.result import Brief
from positioner.estimation.array import Array
from positioner.estimation.likelihood_search import gauss_newton, grid_search, with_start_in_gap
from positioner.estimation.linear_problem import Prior, linear_problem, sensitivities, started
from positioner.estimation.motion_preparation import Beside, PreparedMotion, prepared
from positioner.estimation.motion_segment import MotionSegment


@dataclass(frozen=True, slots=True, repr=False)
class LikelihoodFit(Brief):
    """The most likely parameters.

    Attributes:
        p: (4,), ln τ, ln μ, g in m/Pa, q in m.
        covariance: of p, (4, 4); as good as infinite where nothing is known.
        root: R, (4, 4), of the information about p that beginnings leave, R'R / σ_x^2; as in `Prior`.
        residual_std_m: of the positions.
        count: samples used.
        correlation: of neighbouring residuals: how much they are not white, in standard deviations of it.
        leverage: largest share that a single sample has in what is known of ln μ.
        start_s: when each motion began.
        jumps: how many of the motions were begun by a jump of the pressure.
    """

    p: Array
    covariance: Array
    root: Array
    residual_std_m: float
    count: int
    correlation: float
    leverage: float
    start_s: tuple[float, ...]
    jumps: int

    @property
    def theta(self) -> Array:
        """Return (6,): a in 1/s, b in 1/s^2, c in m/(s^2 Pa), k in m/s^2, b/c in Pa/m, k/c in Pa."""
        tau, mu = np.exp(self.p[:2]).tolist()
        g, q = self.p[2:].tolist()
        return np.array([-tau / mu, -1 / mu, g / mu, q / mu, -1 / g, q / g])

    @property
    def theta_covariance(self) -> Array:
        """Return the covariance of `theta`, (6, 6), to first order, in the products of its units."""
        return np.asarray(self.gradient @ self.covariance @ self.gradient.T)

    @property
    def gradient(self) -> Array:
        """Return the derivatives of `theta` by p, (6, 4)."""
        a, b, c, k, slope, friction = self.theta.tolist()
        g = float(self.p[2])
        return np.array(
            [
                [a, -a, 0.0, 0.0],
                [0.0, -b, 0.0, 0.0],
                [0.0, -c, -b, 0.0],
                [0.0, -k, 0.0, -b],
                [0.0, 0.0, -slope / g, 0.0],
                [0.0, 0.0, -friction / g, 1 / g],
            ]
        )


def fit_motions(
    segments: list[MotionSegment],
    *,
    held: bool,
    guess: Array | None = None,
    prior: Prior | None = None,
    near: Array | None = None,
    beside: Beside = Beside.NOTHING,
) -> LikelihoodFit | None:
    """Fit all motions together, at the minimum of S(p) at the head of this module.

    Args:
        segments: motions of one direction each.
        held: whether the pressure is held between the samples; else it is linear.
        guess: (2,), ln τ and ln μ, τ in s and μ in s^2, to start from beside those of the grid.
        prior: what is known beforehand.
        near: (2,), ln τ and ln μ near enough to need no search.
        beside: what may act beside the model.

    Returns:
        The fit; None when the samples are fewer than the unknowns, or carry no motion.
    """
    motions = [prepared(each, held=held, beside=beside) for each in segments]
    if sum(len(each.position_m) for each in motions) < 6 + 2 * len(motions):
        return None
    start = near if near is not None else grid_search(motions, guess, prior)
    if start is None:
        return None
    placed = [with_start_in_gap(each, motion, start) for each, motion in zip(segments, motions, strict=True)]
    p = np.append(start, [each.start_interval.expected for each in placed if each.start_interval is not None])
    return _fit_at(placed, gauss_newton(placed, p, prior), prior)


def _fit_at(motions: list[PreparedMotion], p: Array, prior: Prior | None) -> LikelihoodFit:
    """Return the fit at the minimum with its covariance."""
    problem = linear_problem(motions, p, prior)
    linear, _ = problem.solved()
    tangent = sensitivities(motions, p, problem, linear, prior)[:, :-1]
    R = np.asarray(np.linalg.qr(tangent, mode="r"))
    residuals = (problem.measured - problem.columns @ linear)[: -4 if prior is not None else None]
    dof = max(1, len(residuals) - (0 if prior is not None else R.shape[1]))
    variance = float(residuals @ residuals) / dof
    order = [R.shape[1] - len(p), R.shape[1] - len(p) + 1, 0, 1]
    scale = np.concatenate((problem.scale, np.ones(len(p))))[order]
    covariance = variance * _inverse_information(R)[np.ix_(order, order)] / np.outer(scale, scale)
    return LikelihoodFit(
        p=np.append(p[:2], linear[:2]),
        covariance=covariance,
        root=_root(tangent, order, scale),
        residual_std_m=variance**0.5,
        count=sum(len(each.position_m) for each in motions),
        correlation=_correlation(residuals),
        leverage=_leverage(tangent, order[1]),
        start_s=tuple(float(each.time_s[0]) for each in started(motions, p)),
        jumps=sum(not each.free_velocity for each in motions),
    )


def _leverage(tangent: Array, number: int) -> float:
    """Return the largest share of a row in the information about a column that all the other columns leave."""
    others = np.linalg.qr(np.delete(tangent, number, axis=1))[0]
    left = tangent[:, number] - others @ (others.T @ tangent[:, number])
    left -= others @ (others.T @ left)
    power = float(left @ left)
    return float((left**2).max()) / power if power > 0 else 1.0


def _root(tangent: Array, order: list[int], scale: Array) -> Array:
    """Return the root of the information about the four parameters, the others eliminated."""
    others = np.delete(tangent, order, axis=1)
    R = np.asarray(np.linalg.qr(np.column_stack((others, tangent[:, order] * scale)), mode="r"))
    return R[-4:, -4:]


def _inverse_information(R: Array) -> Array:
    """Return (R'R)^-1; what carries no information at all gets a variance as good as infinite."""
    _, sizes, rotation = np.linalg.svd(R)
    sizes = np.maximum(sizes, 1e-14 * sizes[0])
    return np.asarray((rotation.T / sizes**2) @ rotation)


def _correlation(residuals: Array) -> float:
    """Return the correlation of neighbours times sqrt(n): beyond some four the residuals are not white."""
    power = float(residuals @ residuals)
    return float(residuals[1:] @ residuals[:-1]) / power * len(residuals) ** 0.5 if power > 0 else 0.0

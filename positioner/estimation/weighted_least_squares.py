"""(13) for several windows at once, each row with the weight that its noise leaves it.

Every window from time zero to some T_j gives three equations q_i = a p_i1 + b p_i2 + c p_i3, and none of them knows k
or how the motion began. In a long window the b and c columns are nearly parallel, but for the jerk at its beginning; a
short one sees little else. Stacked, q = P θ + e, θ = (a, b, c), they are solved by generalised least squares,

    θ = A q,    A = (P' W P)^-1 P' W,    W = (E[e e'] + ε)^-1

White sensor noise ν of standard deviation σ enters every entry through a polynomial kernel,

    δπ_n(T) = ∫_0^T K_n(τ; T) ν(τ) dτ,    K_n(τ; T) = Σ_l g_l τ^(e_l) (T - τ)^(n - l) / (n - l)!

so e = ∫ K ν dτ with K = K_q - a K_p1 - b K_p2, and E[e e'] = σ^2 h ∫ K K' dτ (h: mean step, Σ h^2 / Σ h when uneven).
θ in it is taken from the solution before; the first weighs each row by K_q alone. Noise of the pressure enters in the
same way through c K_p3. What x is not linear between the samples counts as noise besides: a bend of the slope by Δ
leaves out h^2 Δ / 12, whose mean square is taken for each interval between two T_j. So the jerk is trusted as far as it
is sampled.

    first order     cov θ = A E[e e'] A'
    residual        misfit^2 = e' W e / (rows - 3) with e = q - P θ: 1 where noise is all that is left, give or take
                    chance; a sensor that jumped leaves some hundred
    second order    bias = E[-A δP A e + (P' W P)^-1 δP' W (I - P A) e],     for ν is in P as well (errors in variables)

All numbers here are in the units of `Identifier`: windows of time, strokes, units of pressure.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import factorial, sqrt

import numpy as np
import numpy.typing as npt

from positioner.estimation.array import Array

Feeds = tuple[tuple[int, int], ...]

LEVELS = 6
ROWS = (4, 5, 6)
"""The levels that are read: (9)-(12), their integral and their double integral."""

Q: Feeds = ((6, 0), (-18, 1), (9, 2), (-1, 3))
P_A: Feeds = ((-6, 1), (6, 2), (-1, 3))
P_B: Feeds = ((3, 2), (-1, 3))
P_C: Feeds = P_B
CHAINS = (Q, P_A, P_B, P_C)
"""Per column the feeds (g_l, e_l) of its levels l = 1, 2, ...; the first three take x, the last takes u."""

LARGEST_CONDITION = 1e10
"""Beyond this (13) is singular to rounding: the pressure, or the stem, did not move."""
FLOOR = 1e-8
"""ε as a share of each row's variance: rows so nearly parallel as to differ by less differ by rounding."""
ROUNDS = 3
"""Without a guess. The weights need no more than a rough one."""
QUIET = 1e-12
"""Noise of the position that is taken for none."""
_NOISE_IN_BENDS = 6 / 144
"""White noise of variance 1 bends the slope between three samples so that (h Δ / 12)^2 has this mean."""

# Gauss-Legendre on (0, 1): eight nodes integrate the product of two kernels of degree 7 exactly.
_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(8)
_NODES, _NODE_WEIGHTS = (_NODES + 1) / 2, _NODE_WEIGHTS / 2


def kernel(feeds: Feeds, n: int, tau: Array, T: float) -> Array:
    """Return K_n(τ; T), the weight of the signal at tau, (nodes,) both, in level n of a chain at T, in windows."""
    levels = enumerate(feeds[:n], start=1)
    terms = [g * tau**e * (T - tau) ** (n - level) / factorial(n - level) for level, (g, e) in levels]
    return np.asarray(np.sum(terms, axis=0))


def _coefficients() -> Array:
    """Return the kernels' coefficients (4, 6, 12) of τ^e (T - τ)^p, for each column and level read."""
    coefficients = np.zeros((4, LEVELS, len(CHAINS), len(ROWS)))
    for column, feeds in enumerate(CHAINS):
        for row, n in enumerate(ROWS):
            for level, (gain, power) in enumerate(feeds[:n], start=1):
                coefficients[power, n - level, column, row] += gain / factorial(n - level)
    return coefficients.reshape(4, LEVELS, len(CHAINS) * len(ROWS))


_COEFFICIENTS = _coefficients()


@dataclass(frozen=True, slots=True)
class Window:
    """What the chains hold at T = `end`: `columns` (4, 3) are q, p_1, p_2, p_3 of the levels read.

    `squared_steps` is Σ h^2 up to there, `bends` Σ (h^3 x'' / 12)^2: what straight lines between samples leave out.
    """

    end: float
    columns: Array
    squared_steps: float
    bends: float


@dataclass(frozen=True, slots=True)
class Solution:
    """What the identifier says, SI units.

    Attributes:
        theta: a in 1/s, b in 1/s^2, c in m/(s^2 Pa).
        covariance: of theta by noise, first order, 3 x 3.
        bias: of theta by noise in P, second order, 3.
        noise_share: expected size of A δP in units of the parameters; the orders above mean something only while
            it is well below 1.
        condition: of P in its own units.
        gaps: steps over which commands were missed.
        misfit: what is left of the rows, in what noise leaves.
    """

    theta: Array
    covariance: Array
    bias: Array
    noise_share: float
    condition: float
    gaps: int
    misfit: float


def solve(
    windows: Sequence[Window], position_noise: float, pressure_noise: float, guess: Array | None = None, gaps: int = 0
) -> Solution | None:
    """Solve (13) for a, b, c over windows of increasing length.

    Args:
        windows: one at least; each begins at time zero, columns (4, 3).
        position_noise: standard deviation of the white noise of the position.
        pressure_noise: the same of the pressure.
        guess: (3,), of a, b, c, to weigh the rows with; None: found in rounds.
        gaps: handed on.

    Returns:
        The solution in the units of the windows; None when (13) is singular, as under a constant pressure.
    """
    if not windows or windows[-1].end <= 0:
        return None
    kernels, lengths, steps = _kernels(np.array([each.end for each in windows]))
    q, *p = np.array([each.columns for each in windows]).transpose(1, 0, 2).reshape(len(CHAINS), -1)
    P = np.array(p).T
    sizes = np.sqrt(kernels[1:] ** 2 @ lengths).T
    condition = float(np.linalg.cond(P / sizes))
    if not condition < LARGEST_CONDITION:
        return None
    # Without any noise each row is worth what it is to a little of it.
    stem = kernels[:3] * np.sqrt(lengths * _densities(windows, max(position_noise, QUIET))[steps])
    drive = kernels[3] * np.sqrt(lengths * _densities(windows, 0.0, pressure_noise)[steps])
    return _weighed(q, P, stem, drive, guess, condition, gaps)


def _kernels(ends: Array) -> tuple[Array, Array, "npt.NDArray[np.intp]"]:
    """Return the kernels (4, rows, nodes) at nodes between the windows' ends, the nodes' lengths and intervals."""
    begins = np.concatenate(((0.0,), ends[:-1]))
    spans = (ends - begins)[:, None]
    tau = (begins[:, None] + spans * _NODES).ravel()
    lengths = (spans * _NODE_WEIGHTS).ravel()
    left = np.maximum(ends[:, None] - tau, 0.0)
    powers = np.empty((LEVELS, len(ends) * len(tau)))
    powers[0] = (left > 0).ravel()
    for p in range(1, LEVELS):
        np.multiply(powers[p - 1], left.ravel(), out=powers[p])
    # One small product after another: a large one wakes the threads of the linear algebra, which take longer.
    found = np.zeros((len(CHAINS) * len(ROWS), powers.shape[1]))
    tau_e: Array = np.ones(powers.shape[1])
    for coefficients in _COEFFICIENTS:
        found += tau_e * (coefficients.T @ powers)
        tau_e = tau_e * np.tile(tau, len(ends))
    shaped = found.reshape(len(CHAINS), len(ROWS), len(ends), len(tau)).transpose(0, 2, 1, 3)
    intervals = np.repeat(np.arange(len(ends)), len(_NODES))
    return shaped.reshape(len(CHAINS), len(ROWS) * len(ends), len(tau)), lengths, intervals


def _densities(windows: Sequence[Window], position_noise: float, pressure_noise: float | None = None) -> Array:
    """Return σ^2 h of each interval between the windows' ends: of the position, or of the pressure if given."""
    ends = np.diff([0.0, *(each.end for each in windows)])
    squares = np.diff([0.0, *(each.squared_steps for each in windows)])
    if pressure_noise is not None:
        return np.asarray(pressure_noise**2 * squares / ends)
    noise = position_noise**2 * squares
    bends = np.diff([0.0, *(each.bends for each in windows)])
    return np.asarray((noise + np.maximum(bends - _NOISE_IN_BENDS * noise, 0.0)) / ends)


def _weighed(
    q: Array, P: Array, stem: Array, drive: Array, guess: Array | None, condition: float, gaps: int
) -> Solution:
    """Return the solution; `stem` (3, rows, nodes) is the noise in (q, p_1, p_2), `drive` that in p_3."""
    theta = guess
    if theta is None:
        theta = _inverse(P, np.diag(1 / np.sqrt((stem[0] ** 2).sum(axis=1)))) @ q
    for _ in range(ROUNDS if guess is None else 1):
        error = stem[0] - theta[0] * stem[1] - theta[1] * stem[2]
        drive_error = -theta[2] * drive
        weights = _root_of_inverse(error @ error.T + drive_error @ drive_error.T)
        A = _inverse(P, weights)
        theta = A @ q

    first, of_drive = A @ error, A @ drive_error
    covariance = first @ first.T + of_drive @ of_drive.T  # but for ε this is (P' W P)^-1
    in_columns = (A @ stem[1], A @ stem[2], A @ drive)
    second = -(in_columns[0] @ first[0] + in_columns[1] @ first[1] + in_columns[2] @ of_drive[2])
    left, left_drive = (weights.T @ (weights @ (each - P @ (A @ each))) for each in (error, drive_error))
    second += covariance @ [(stem[1] * left).sum(), (stem[2] * left).sum(), (drive * left_drive).sum()]
    shares = np.sqrt((np.array(in_columns) ** 2).sum(axis=2)) * theta[:, None] / theta
    return Solution(
        theta=theta,
        covariance=covariance,
        bias=second,
        noise_share=float(np.linalg.norm(shares)),
        condition=condition,
        gaps=gaps,
        misfit=_misfit(weights @ (q - P @ theta)),
    )


def _misfit(white: Array) -> float:
    """Return the size of residuals that are white where noise is all, (rows,); three rows say nothing."""
    free = len(white) - 3
    return sqrt(float(white @ white) / free) if free > 0 else 0.0


def _root_of_inverse(spread: Array) -> Array:
    """Return V, V' V = (spread + ε)^-1."""
    size = np.sqrt(np.diag(spread))
    correlation = spread / size / size[:, None]
    correlation.flat[:: len(size) + 1] += FLOOR
    return np.asarray(np.linalg.inv(np.linalg.cholesky(correlation))) / size


def _inverse(P: Array, weights: Array) -> Array:
    """Return (P' W P)^-1 P' W, W = weights' weights."""
    size = np.abs(P).max(axis=0)
    white = weights @ (P / size)
    R: Array = np.asarray(np.linalg.qr(white, mode="r"))
    found = np.linalg.solve(R, np.linalg.solve(R.T, white.T @ weights))
    return np.asarray(found / size[:, None], dtype=np.float64)

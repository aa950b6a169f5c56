"""The algebraic identifier: a, b, c of the moving stem from running integrals, (8)-(16), (29)-(33) of the seed.

    x'' = a x' + b x + c u + k        while the stem moves one way; k carries the sign of the motion

Multiplied by s and differentiated three times with respect to s, this loses k and the initial conditions; divided
by s^4 it loses the derivatives. With P(f, n) the n-fold integral of f from 0 to t, and T = t at read-out:

    q_1  = P(-t^3 x, 1) + 9 P(t^2 x, 2) + 18 P(-t x, 3) + 6 P(x, 4)               (9)
    p_11 = P(-t^3 x, 2) + 6 P(t^2 x, 3) + 6 P(-t x, 4)                            (10), its sign corrected
    p_12 = P(-t^3 x, 3) + 3 P(t^2 x, 4)                                           (11)
    p_13 = P(-t^3 u, 3) + 3 P(t^2 u, 4)                                           (12)
    q_i  = a p_i1 + b p_i2 + c p_i3,   row i + 1 the integral of row i            (8), (13)-(16)

Each of the four columns is a chain of six integrators, (29)-(33), fed at level l with g_l t^(e_l) times its signal:

    π_1' = g_1 t^(e_1) x,    π_n' = g_n t^(e_n) x + π_(n-1),    rows 1, 2, 3 = π_4, π_5, π_6

A step of the chain is exact for x linear between the samples, and for u held or linear (see `Identifier`). In units
of the step itself it is the same matrix for every step; π_n carries the weight h^(n + e_1).

White sensor noise ν of standard deviation σ enters every entry through a polynomial kernel,

    δπ_n(T) = ∫_0^T K_n(τ; T) ν(τ) dτ,    K_n(τ; T) = Σ_l g_l τ^(e_l) (T - τ)^(n - l) / (n - l)!

With K = K_q - a K_p1 - b K_p2 and δθ = P^-1 ∫ K ν dτ, θ = (a, b, c), the first order is

    cov θ = σ^2 h P^-1 ∫ K K' dτ P^-T          h: mean step, Σ h^2 / Σ h when uneven

and since ν is in P as well (errors in variables), the second order is a bias, -E[P^-1 δP δθ]. Noise of the pressure
enters in the same way through K_p3.

Inside, time counts in windows, x in strokes, u in units of a pressure; time zero is the restart.
"""

from dataclasses import dataclass
from math import comb, factorial

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
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

STATES = LEVELS * len(CHAINS)
FEEDS = 8
"""Numbers by which a signal enters a step: its value and its increment, times the powers 0 to 3 of time."""


def _monomial(i: int, m: int) -> float:
    """∫_0^1 s^i (1 - s)^m / m! ds."""
    return factorial(i) / factorial(m + i + 1)


def _step_matrix() -> Array:
    """Return the exact step of all chains in units of the step: (states, x feeds, u feeds) -> states."""
    step = np.zeros((STATES, STATES + 2 * FEEDS))
    for chain, feeds in enumerate(CHAINS):
        signal = STATES + FEEDS * (chain == len(CHAINS) - 1)
        for n in range(1, LEVELS + 1):
            row = step[LEVELS * chain + n - 1]
            for m in range(n):
                row[LEVELS * chain + n - 1 - m] = 1 / factorial(m)
            for level, (gain, power) in enumerate(feeds[:n], start=1):
                for p in range(power + 1):
                    weight = gain * comb(power, p)
                    row[signal + p] += weight * _monomial(power - p, n - level)
                    row[signal + FEEDS // 2 + p] += weight * _monomial(power - p + 1, n - level)
    return step


_STEP = _step_matrix()
_WEIGHTS = np.array([n + feeds[0][1] for feeds in CHAINS for n in range(1, LEVELS + 1)], dtype=float)
_READ = np.array([[LEVELS * chain + n - 1 for n in ROWS] for chain in range(len(CHAINS))])

# Gauss-Legendre on (0, 1): eight nodes integrate the product of two kernels of degree 7 exactly.
_NODES, _NODE_WEIGHTS = np.polynomial.legendre.leggauss(8)
_NODES, _NODE_WEIGHTS = (_NODES + 1) / 2, _NODE_WEIGHTS / 2


def kernel(feeds: Feeds, n: int, tau: Array, T: float) -> Array:
    """Return K_n(τ; T), the weight of the signal at τ in level n of a chain at T."""
    levels = enumerate(feeds[:n], start=1)
    terms = [g * tau**e * (T - tau) ** (n - level) / factorial(n - level) for level, (g, e) in levels]
    return np.asarray(np.sum(terms, axis=0))


_KERNELS = np.array([[kernel(feeds, n, _NODES, 1.0) for n in ROWS] for feeds in CHAINS])
_SIZES = np.sqrt(_KERNELS**2 @ _NODE_WEIGHTS)
"""What a row of a column is for a signal of one unit: the kernel's length."""

GAP = 4.0
"""A step longer than this many mean steps has missed commands."""
LARGEST_CONDITION = 1e10
"""Beyond this (13) is singular to rounding: the pressure, or the stem, did not move."""


@dataclass(frozen=True, slots=True)
class Solution:
    """What the identifier says, SI units.

    Attributes:
        theta: a in 1/s, b in 1/s^2, c in m/(s^2 Pa).
        covariance: of theta by noise, first order, 3 x 3.
        bias: of theta by noise in P, second order, 3.
        noise_share: expected size of P^-1 δP in units of the parameters; the orders above mean something only while
            it is well below 1.
        condition: of P in its own units.
        gaps: steps over which commands were missed.
    """

    theta: Array
    covariance: Array
    bias: Array
    noise_share: float
    condition: float
    gaps: int


class Identifier:
    """Running realisation of the identifier: O(1) per sample, restartable at any instant.

    Args:
        window_s: unit of time, the length of window it is meant for.
        stroke_m: unit of position.
        pressure_pa: unit of pressure.
        pressure_held: True when the pressure of a sample has held since the one before (command held over the
            period, no I/P lag); False when it is continuous, and taken as linear between the samples.
    """

    def __init__(self, window_s: float, stroke_m: float, pressure_pa: float, *, pressure_held: bool = True) -> None:
        self._window_s, self._stroke_m, self._pressure_pa = window_s, stroke_m, pressure_pa
        self._pressure_held = pressure_held
        self._unit = np.array([1 / window_s, 1 / window_s**2, stroke_m / (pressure_pa * window_s**2)])
        self._z = np.zeros(STATES + 2 * FEEDS)
        self.restart()

    def restart(self) -> None:
        """Forget everything; the next sample is time zero."""
        self._z[:] = 0
        self._started = False
        self._t = self._h = self._squared_steps = 0.0
        self._gaps = 0

    @property
    def elapsed_s(self) -> float:
        """Time from the first to the last sample."""
        return self._t * self._window_s

    def update(self, time_s: float, position_m: float, pressure_pa: float) -> None:
        """Take a sample.

        Raises:
            ValueError: the time stamp is not after the last one.
        """
        x, u = position_m / self._stroke_m, pressure_pa / self._pressure_pa
        if not self._started:
            self._zero_s, self._x, self._u, self._started = time_s, x, u, True
            return
        t = (time_s - self._zero_s) / self._window_s
        h = t - self._t
        if h <= 0:
            raise ValueError(f"time_s: {time_s!r} is not after the last sample")
        z = self._z
        if h != self._h:
            if self._h:
                z[:STATES] *= (self._h / h) ** _WEIGHTS
            self._h = h
        k = self._t / h
        k2, k3 = k * k, k * k * k
        x0, dx = self._x, x - self._x
        # Over a gap the commands in between are not known: a line through them is nearer than the last of them.
        gap = h * self._t > GAP * self._squared_steps > 0
        self._gaps += gap
        u0, du = (u, 0.0) if self._pressure_held and not gap else (self._u, u - self._u)
        z[STATES:] = (
            x0, k * x0, k2 * x0, k3 * x0, dx, k * dx, k2 * dx, k3 * dx,
            u0, k * u0, k2 * u0, k3 * u0, du, k * du, k2 * du, k3 * du,
        )  # fmt: skip
        z[:STATES] = _STEP.dot(z)
        self._t, self._x, self._u = t, x, u
        self._squared_steps += h * h

    def integrals(self) -> tuple[Array, Array]:
        """Return q (3) and P (3 x 3) of (13), in windows, strokes and units of pressure."""
        columns = (self._z[:STATES] * self._h**_WEIGHTS)[_READ]
        return columns[0], columns[1:].T

    def solve(self, position_noise_m: float, pressure_noise_pa: float = 0.0) -> Solution | None:
        """Solve (13) for a, b, c.

        Args:
            position_noise_m: standard deviation of the white noise of the position.
            pressure_noise_pa: the same of the pressure.

        Returns:
            The solution; None when (13) is singular, as under a constant pressure.
        """
        q, P = self.integrals()
        degrees = _WEIGHTS[_READ] - 1
        sizes = (_SIZES * self._t ** (degrees + 1))[1:].T
        condition = float(np.linalg.cond(P / sizes)) if self._t else np.inf
        if not condition < LARGEST_CONDITION:
            return None
        inverse = np.linalg.inv(P / sizes[:, :1]) / sizes[:, 0]
        theta = inverse @ q

        # P^-1 applied to the noise of (q, p_1, p_2, p_3), node by node of the window.
        unit_noise = np.sqrt(self._squared_steps * _NODE_WEIGHTS)
        kernels = _KERNELS * (self._t**degrees)[:, :, None] * unit_noise
        stem = inverse @ kernels[:3] * (position_noise_m / self._stroke_m)
        drive = inverse @ kernels[3] * (pressure_noise_pa / self._pressure_pa)
        error = stem[0] - theta[0] * stem[1] - theta[1] * stem[2]
        drive_error = -theta[2] * drive
        bias = -(stem[1] @ error[0] + stem[2] @ error[1] + drive @ drive_error[2])
        noise_in_columns = np.sqrt((np.array([stem[1], stem[2], drive]) ** 2).sum(axis=2))
        unit = self._unit
        return Solution(
            theta=theta * unit,
            covariance=(error @ error.T + drive_error @ drive_error.T) * np.outer(unit, unit),
            bias=bias * unit,
            noise_share=float(np.linalg.norm(noise_in_columns * theta[:, None] / theta)),
            condition=condition,
            gaps=self._gaps,
        )

"""Velocity and acceleration at the END of a window: the derivative estimators (19), (21) of the seed as FIR filters.

Over a window of length T that ends now, with τ counted back from now, the kernels (19) and (21) read

    x'(t)  =  12 / T^4  ∫_0^T (3 T^2 - 16 T τ + 15 τ^2) x(t - τ) dτ
    x''(t) = 120 / T^6  ∫_0^T (4 T^3 - 45 T^2 τ + 108 T τ^2 - 70 τ^3) x(t - τ) dτ

(as printed they run forward from the START of the window and give the derivative there; reversed in time, the odd
derivative changes its sign). Each is the one polynomial K of degree p = 2 or 3 that fulfils the moment conditions

    ∫ K(τ) (-τ)^i dτ = d! if i = d, else 0,     i = 0 .. p,     d = 1 or 2: the order of the derivative

so it is exact for polynomials up to degree p. A sum over N samples in place of the integral breaks the conditions,
and the leak of the constant and the linear part (x is 10^4 times T^2 x'') swamps the derivative. So the coefficients
of K are found from the same conditions with the sum over the samples in place of the integral, on whatever grid these
lie: exact again, and the printed kernel in the limit of N. White noise of standard deviation σ comes out as σ ||w||,
w the weights: near sqrt(192 / N) / T and sqrt(25920 / N) / T^2.

The straight line's slope, the same with p = d = 1, is the third filter: the velocity of the window as a whole, for its
middle. It is a mean of x(τ_2) - x(τ_1) over τ_1 < τ_2, so as long as the stem moves one way it has that sign, which
the parabola's has not where the motion begins with a jerk. Its noise is near sqrt(12 / N) / T.

The price of the end of the window is noise, that of its middle a delay of T / 2: see docs/estimation.md.
"""

import numpy as np

from positioner.estimation.array import Array

EVEN = 1e-5
"""Steps whose differences from their mean have a norm below this share of it count as even."""

SHORTEST = 6
"""Least number of samples in a window: two more than the cubic has coefficients."""


def weights(time_s: Array) -> Array:
    """Return the weights (3, N) whose sums with N positions are velocity and acceleration at the last, and slope.

    (19), (21) and the straight line's slope, exact for polynomials on the grid there is; in 1/s, 1/s^2 and 1/s.

    Args:
        time_s: (N,), N >= 6 increasing time stamps, s.

    >>> t = np.linspace(0.0, 0.05, 51)
    >>> (weights(t) @ (3.0 * t + 5.0 * t**2)).round(6).tolist()
    [3.5, 10.0, 3.25]
    """
    half = (time_s[-1] - time_s[0]) / 2
    powers = np.ones((4, len(time_s)))
    s = powers[1]
    np.subtract(time_s, time_s[-1], out=s)
    s /= half
    s += 1.0  # -1 .. 1, now at 1
    np.multiply(s, s, out=powers[2])
    np.multiply(powers[2], s, out=powers[3])
    coefficients = np.array(_coefficients(powers.dot(powers.T).tolist()))
    coefficients /= half
    coefficients[1] /= half
    return np.asarray(coefficients.dot(powers))


def _coefficients(moments: list[list[float]]) -> list[list[float]]:
    """Return the coefficients of the kernels in powers of s from the sums M over the grid.

    The conditions are M c = e, M_ij = Σ s^(i + j) and e_i the derivative of s^i at s = 1. One factorisation
    M = L D L' of the cubic's M serves all: its leading blocks are the parabola's and the line's. Written out, for
    speed.
    """
    (s0, s1, s2, s3), (*_, s4), (*_, s5), (*_, s6) = moments
    l10, l20, l30 = s1 / s0, s2 / s0, s3 / s0
    d1 = s2 - l10 * s1
    l21, l31 = (s3 - l20 * s1) / d1, (s4 - l30 * s1) / d1
    d2 = s4 - l20 * s2 - l21 * l21 * d1
    l32 = (s5 - l30 * s2 - l31 * l21 * d1) / d2
    d3 = s6 - l30 * s3 - l31 * l31 * d1 - l32 * l32 * d2

    v2 = (2 - l21) / d2  # e = 0, 1, 2
    v1 = 1 / d1 - l21 * v2
    v0 = -l10 * v1 - l20 * v2

    a3 = (6 - 2 * l32) / d3  # e = 0, 0, 2, 6
    a2 = 2 / d2 - l32 * a3
    a1 = -l21 * a2 - l31 * a3
    a0 = -l10 * a1 - l20 * a2 - l30 * a3
    return [[v0, v1, v2, 0.0], [a0, a1, a2, a3], [-l10 / d1, 1 / d1, 0.0, 0.0]]


class Derivatives:
    """The filters over one window; the weights are kept as long as the grid stays even."""

    def __init__(self) -> None:
        self._count, self._step = 0, 0.0
        self._last_s, self._alike = 0.0, 0
        self.weights = np.zeros((3, 0))
        self.slope_gain = 0.0

    def estimate(self, time_s: Array, position_m: Array) -> tuple[float, float, float]:
        """Return velocity and acceleration at the last of N >= 6 samples, oldest first, and the slope; SI units.

        Afterwards `weights` are those used, and `slope_gain` is the standard deviation of the slope for white noise
        of one metre, in 1/s.
        """
        if not self._goes_on(time_s):
            self._look_at(time_s)
        velocity_m_per_s, acceleration_m_per_s2, slope_m_per_s = self.weights.dot(position_m).tolist()
        return velocity_m_per_s, acceleration_m_per_s2, slope_m_per_s

    def _goes_on(self, time_s: Array) -> bool:
        """Return whether the window moved on by a sample, and every step in it is one by which the weights hold.

        Each then differs from theirs by less than EVEN / sqrt(N): their norm need not be worked out anew.
        """
        last_s, count = float(time_s[-1]), self._count
        follows = count == len(time_s) and time_s[-2] == self._last_s
        off = last_s - self._last_s - self._step
        alike = follows and count * off * off < (EVEN * self._step) ** 2
        self._last_s, self._alike = last_s, self._alike + 1 if alike else 0
        return self._alike >= count > 0

    def _look_at(self, time_s: Array) -> None:
        """Work out the weights of a window, unless it is as even as the one before, and by the same step."""
        steps = time_s[1:] - time_s[:-1]
        step = float(time_s[-1] - time_s[0]) / len(steps)
        tolerance = EVEN * step
        steps -= step
        even = steps.dot(steps) < tolerance * tolerance
        if not (even and self._count == len(time_s) and abs(step - self._step) < tolerance):
            self._count, self._step = (len(time_s), step) if even else (0, 0.0)
            self._alike = 0
            self.weights = weights(time_s)
            slope = self.weights[2]
            self.slope_gain = float(slope.dot(slope)) ** 0.5

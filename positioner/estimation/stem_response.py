"""The stem in motion, exactly at the samples: what the maximum-likelihood fit compares with the measurement.

While the stem moves one way, σ = +1 or -1, the model x'' = a x' + b x + c u + k σ, divided by -b = k_s/m, reads

    μ x'' + τ x' + x = g u + q σ        μ = m/k_s in s^2,  τ = F_v/k_s in s,  g = A/k_s in m/Pa,  q = -F_c/k_s in m
    a = -τ/μ,  b = -1/μ,  c = g/μ,  k = q/μ,    b/c = -1/g,  k/c = q/g

It is linear in g, q and in where and how fast the motion began, so

    x(t) = g X_g + q X_q + x_0 X_0 + v_0 X_1

With λ_1, λ_2 the roots of μ λ^2 + τ λ + 1 = 0 and y_j' = λ_j y_j + w, the response to an input w/μ is
(y_1 - y_2) / (λ_1 - λ_2). For an input that is held (the value at a sample is that of the interval before it) or
linear between the samples, the step from one sample to the next is exact for any length h:

    y(t + h) = e^(λh) y(t) + h φ_1(λh) w                      held;    φ_1(z) = (e^z - 1)/z
    y(t + h) = e^(λh) y(t) + h (φ_1 - φ_2) w_0 + h φ_2 w_1    linear;  φ_2(z) = (e^z - 1 - z)/z^2

The recursion is summed by doubling: after n rounds y holds the last 2^n steps, so N samples cost log2 N vector
operations, however uneven. X_q, X_0 and X_1 have closed forms.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

from positioner.estimation.array import Array

Modes = npt.NDArray[Any]
"""A row per root: real for an overdamped stem, complex for one that rings."""

_EQUAL = 1e-10
"""Roots nearer than this, as a share of the discriminant's size, are moved apart: the error is of that order."""
_SMALL = 1e-3
"""Below this |z| the series of φ_2 is exact to rounding, and the quotient is not."""
_FADED = -36.0
"""e to this is less than rounding leaves of 1."""


def roots(tau_s: float, mu_s2: float) -> Modes:
    """Return λ_1, λ_2, (2,), in 1/s: the roots of μ λ^2 + τ λ + 1, never quite equal.

    >>> roots(tau_s=0.03, mu_s2=2e-4).round(6).tolist()
    [-50.0, -100.0]
    """
    discriminant = tau_s * tau_s - 4 * mu_s2
    if abs(discriminant) < _EQUAL * tau_s * tau_s:
        discriminant = _EQUAL * tau_s * tau_s
    if discriminant > 0:
        slow = -2 / (tau_s + discriminant**0.5)  # no difference of nearly equal numbers, however small μ is
        return np.array([slow, 1 / (mu_s2 * slow)])
    half = (-tau_s + 1j * (-discriminant) ** 0.5) / (2 * mu_s2)
    return np.array([half, half.conjugate()])


def responses(
    time_s: Array, pressure_pa: Array, direction: int, tau_s: float, mu_s2: float, *, held: bool
) -> tuple[Array, Array, Array, Array]:
    """Return X_g (m per m/Pa), X_q, X_0 (1) and X_1 (s) at N + 1 instants, the first of which is the start.

    Args:
        time_s: (N + 1,), increasing instants.
        pressure_pa: (N + 1,), at each; held: of the interval before each, the first then does not matter.
        direction: +1 up, -1 down.
        tau_s: F_v/k_s.
        mu_s2: m/k_s.
        held: how the pressure goes between the instants.
    """
    root = roots(tau_s, mu_s2)[:, None]
    spread = (root[0] - root[1])[0]
    elapsed = time_s - time_s[0]
    decay = np.exp(root * elapsed)
    X_1 = _real((decay[0] - decay[1]) / spread)
    X_0 = _real((root[0] * decay[1] - root[1] * decay[0]) / spread)
    X_q = direction * (1.0 - X_0)  # at rest at the start, drawn towards 1
    y = _driven(root, time_s, elapsed, pressure_pa, held=held)
    return _real((y[0] - y[1]) / (spread * mu_s2)), X_q, X_0, X_1


def _driven(root: Modes, time_s: Array, elapsed: Array, pressure_pa: Array, *, held: bool) -> Modes:
    """Return y_1, y_2 (2, N + 1) from zero at the start."""
    h = np.diff(time_s)
    z = root * h
    first = _phi_1(z)
    y = np.zeros((2, len(time_s)), dtype=z.dtype)
    if held:
        y[:, 1:] = h * first * pressure_pa[1:]
    else:
        second = _phi_2(z, first)
        y[:, 1:] = h * ((first - second) * pressure_pa[:-1] + second * pressure_pa[1:])
    slowest = float(root.real.max())
    lag = 1
    while lag < len(time_s):
        span = elapsed[lag:] - elapsed[:-lag]
        if slowest * float(span.min()) < _FADED:
            break
        y[:, lag:] += np.exp(root * span) * y[:, :-lag]
        lag *= 2
    return y


def _phi_1(z: Modes) -> Modes:
    return np.expm1(z) / z


def _phi_2(z: Modes, first: Modes) -> Modes:
    series = 0.5 + z / 6 + z * z / 24 + z * z * z / 120
    return np.where(np.abs(z) < _SMALL, series, (first - 1) / z)


def _real(values: Modes) -> Array:
    return np.asarray(values.real, dtype=np.float64)

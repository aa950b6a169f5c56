"""The friction estimator (22): what the moving stem's acceleration leaves over.

    k_e = σ (x'' - a_e x' - b_e x - c_e u),    σ = sign(x')        corrected; k = -F_c / m, in m/s^2

It is linear in (a, b, c), so the means of x'', x', x and u over the motion are all that is kept, and the friction of
the whole window follows at read-out from the parameters that are best then:

    k_e   = σ (m - a v - b x - c u)          m, v, x, u: the means
    k_e/c = σ ((m - a v - b x) / c - u)      (the law's k/c needs neither c nor a well)

Standard deviation, besides that of (a, b, c) and their covariance: white noise of the filtered part, mean(x'' - a x').
The weights of a derivative sum to zero, so over M outputs of an N-sample filter all but the ends cancel:

    variance = 2 σ_x^2 Σ_j W_j^2 / M^2,    W the running sum of w_2 - a w_1

and b^2 σ_x^2 / M of mean(x).
"""

from dataclasses import dataclass

import numpy as np

from positioner.estimation.array import Array


def friction(
    direction: int,
    acceleration_m_per_s2: float,
    velocity_m_per_s: float,
    position_m: float,
    pressure_pa: float,
    theta: Array,
) -> float:
    """Return k_e by (22), in m/s^2, of one instant or of means; theta = (a, b, c), (3,), in 1/s, 1/s^2, m/(s^2 Pa)."""
    a, b, c = theta.tolist()
    left_over = acceleration_m_per_s2 - a * velocity_m_per_s - b * position_m - c * pressure_pa
    return direction * float(left_over)


@dataclass(frozen=True, slots=True)
class Means:
    """Means over the motion, SI units; `filter_noise` is the standard deviation of mean(x'' - a x' - b x) per metre."""

    acceleration_m_per_s2: float
    velocity_m_per_s: float
    position_m: float
    pressure_pa: float
    count: int
    weights: Array

    def filter_noise(self, a: float, b: float) -> float:
        """Return the standard deviation of mean(x'' - a x' - b x) for white noise of one metre, in 1/s^2."""
        running = np.cumsum(self.weights[1] - a * self.weights[0])
        return float(np.sqrt(2 * running.dot(running) + b * b * self.count)) / self.count


class RunningMeans:
    """Sums behind `Means`; O(1) per sample."""

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget everything."""
        self._count = 0
        self._acceleration = self._velocity = self._position = self._pressure = 0.0

    def add(self, acceleration: float, velocity: float, position: float, pressure: float) -> None:
        """Take the derivatives, position and pressure of one instant, SI units."""
        self._count += 1
        self._acceleration += acceleration
        self._velocity += velocity
        self._position += position
        self._pressure += pressure

    def means(self, weights: Array) -> Means | None:
        """Return the means, None when there are none; weights (2, N) are those of the derivative filters."""
        n = self._count
        if not n:
            return None
        return Means(self._acceleration / n, self._velocity / n, self._position / n, self._pressure / n, n, weights)

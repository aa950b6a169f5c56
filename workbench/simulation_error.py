"""The error of a free run as a function of the free coordinates, and the search for its least.

    r_i = (simulated_i - measured_i) / sigma,    cost_s = sum s^2 (sqrt(1 + (r_i / s)^2) - 1)       soft L1 of scale s

The cost is a staircase: a slip happens or does not. So the scale falls, 100, 30, 5 sigma, and with it the step of the
forward differences, 1e-3, 3e-4, 1e-4 of a log-parameter: large errors are first bounded, then resolved. Polling
ends the search where derivatives see no further.
"""

import numpy as np
from numpy.typing import NDArray

from sim.composition import Composition
from sim.karnopp import Vector
from workbench.free_run import FreeRun
from workbench.parameters import Parameter

SCALES = (100.0, 30.0, 5.0)
STEPS = (1e-3, 3e-4, 1e-4)
FINAL = SCALES[-1]
POLLS = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4)
MOST_ITERATIONS = 12
MOST_DAMPINGS = 5
MOST_SWEEPS = 8
NOTICED = 1e-4
"""Relative fall of the cost for which polling goes on."""
LONGEST_MOVE = 0.5
"""Of a log-parameter in one iteration."""
ENOUGH = 1e-5
"""Relative fall of the cost below which a scale is done."""
HOPELESS = 1e6
"""What a residual that is not finite counts, in sigma."""


class SimulationError:
    """A free run held against its record, over the coordinates of some parameters."""

    def __init__(
        self, run: FreeRun, composition: Composition, parameters: tuple[Parameter, ...], theta: Vector
    ) -> None:
        record = run.record
        self.parameters = parameters
        self.run = run
        simulated = np.zeros(len(record), dtype=np.bool_)
        for first, end in record.segments:
            simulated[first:end] = True
        self._rows = np.flatnonzero(simulated & record.judged)
        self._measured_m = record.position_m[self._rows]
        self.sigma_m = record.noise_m or 1e-6 * composition.valve.stroke_m
        self._theta = np.array(theta)
        bounds = np.array([each.bounds for each in parameters]).reshape(-1, 2)
        self.lower, self.upper = bounds[:, 0], bounds[:, 1]

    @property
    def count(self) -> int:
        """Number of judged samples."""
        return len(self._rows)

    def theta(self, z: Vector) -> Vector:
        """Return the parameter vector at z."""
        theta = self._theta.copy()
        for parameter, value in zip(self.parameters, z.tolist(), strict=True):
            parameter.put(theta, value)
        return theta

    def coordinates(self, theta: Vector) -> Vector:
        """Return z of a parameter vector, inside the bounds."""
        z = np.array([each.coordinate(theta) for each in self.parameters])
        return np.asarray(np.clip(z, self.lower, self.upper))

    def residuals(self, z: Vector) -> Vector:
        """Return r, one a judged sample."""
        error = (self.run.position_m(self.theta(z))[self._rows] - self._measured_m) / self.sigma_m
        return np.clip(np.nan_to_num(error, nan=HOPELESS, posinf=HOPELESS, neginf=-HOPELESS), -HOPELESS, HOPELESS)

    def cost(self, z: Vector, scale: float = FINAL) -> float:
        """Return the soft-L1 cost, half a sum of squares for small residuals."""
        return soft(self.residuals(z), scale)

    def rms_m(self, z: Vector) -> float:
        """Return the plain rms error, m."""
        return self.sigma_m * float(np.sqrt(np.mean(self.residuals(z) ** 2)))

    def jacobian(self, z: Vector, step: float) -> NDArray[np.float64]:
        """Return dr/dz by differences of that step, forward but for the upper bound: (judged samples, parameters)."""
        here = self.residuals(z)
        columns = []
        for i in range(z.size):
            there = z.copy()
            there[i] += step if z[i] + step <= self.upper[i] else -step
            columns.append((self.residuals(there) - here) / (there[i] - z[i]))
        return np.array(columns).T

    def descended(self, z: Vector) -> Vector:
        """Go down from z through the falling scales."""
        for scale, step in zip(SCALES, STEPS, strict=True):
            z = self._levenberg_marquardt(z, scale, step)
        return z

    def _levenberg_marquardt(self, z: Vector, scale: float, step: float) -> Vector:
        """Go down at one scale: normal equations weighted by 1 / sqrt(1 + (r / s)^2), damped until the cost falls."""
        damping = 1e-3
        residuals = self.residuals(z)
        cost = soft(residuals, scale)
        for _ in range(MOST_ITERATIONS):
            weights = 1.0 / np.sqrt(1.0 + (residuals / scale) ** 2)
            J = self.jacobian(z, step)
            gradient = J.T @ (weights * residuals)
            curvature = (J.T * weights) @ J
            ridge = np.diag(np.maximum(np.diag(curvature), 1e-9))
            before = cost
            for _ in range(MOST_DAMPINGS):
                move = np.linalg.solve(curvature + damping * ridge, -gradient)
                there = np.clip(z + np.clip(move, -LONGEST_MOVE, LONGEST_MOVE), self.lower, self.upper)
                tried = self.residuals(there)
                if soft(tried, scale) < cost:
                    z, residuals, cost = there, tried, soft(tried, scale)
                    damping *= 0.2
                    break
                damping *= 6.0
            if cost > before * (1.0 - ENOUGH):
                return z
        return z

    def polled(self, z: Vector) -> Vector:
        """Try each direction both ways by falling steps until none helps.

        The directions are the coordinates and the eigenvectors of J'J, which follow the valleys.
        """
        best = self.cost(z)
        J = self.jacobian(z, STEPS[0])
        _, vectors = np.linalg.eigh(J.T @ J)
        ways = [*np.eye(z.size), *(vectors / np.max(np.abs(vectors), axis=0)).T]
        for step in POLLS:
            for _ in range(MOST_SWEEPS):
                before = best
                for way in (sign * step * each for each in ways for sign in (1.0, -1.0)):
                    there = np.clip(z + way, self.lower, self.upper)
                    cost = self.cost(there)
                    if cost < best * (1.0 - NOTICED):
                        z, best = there, cost
                if best == before:
                    break
        return z


def soft(residuals: Vector, scale: float) -> float:
    """Return the soft-L1 cost."""
    return float(scale**2 * np.sum(np.sqrt(1.0 + (residuals / scale) ** 2) - 1.0))

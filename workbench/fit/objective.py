"""The error of a free run as a function of the free coordinates, and the search for its least.

    r_i = (simulated_i - measured_i) / sigma,    cost_s = sum s^2 (sqrt(1 + (r_i / s)^2) - 1)       soft L1 of scale s

The cost is a staircase: a slip happens or does not. So the scale falls, 100, 30, 5 sigma, and with it the step of the
forward differences, 1e-3, 3e-4, 1e-4 of a log-parameter: large errors are first bounded, then resolved. Polling
ends the search where derivatives see no further.

The wide scales do with a simulation of longer steps (`rough`); what is compared in the end is always the fine one.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sim.composition import Composition
from sim.karnopp import Vector
from workbench.model.free_run import ROUGH, FreeRun
from workbench.model.parameters import Parameter


@dataclass(frozen=True, slots=True)
class Level:
    """A stage of the descent."""

    scale: float
    """Of the soft-L1 cost, in sigma."""
    difference: float
    """Step of the forward differences."""
    enough: float
    """Relative fall of the cost in an iteration below which the level is done."""


WIDE, MIDDLE, NARROW = Level(100.0, 1e-3, 1e-2), Level(30.0, 3e-4, 1e-3), Level(5.0, 1e-4, 1e-4)
LAST = Level(5.0, 1e-3, 1e-4)
"""From where polling ends: the valleys are bent there, and too wide for the narrow differences."""
FINAL = NARROW.scale
STRIDES = (0.5, 0.2, 0.07)
POLLS = (3e-2, 1e-2, 3e-3, 1e-3, 3e-4)
MOST_ITERATIONS = 12
MOST_DAMPINGS = 5
MOST_SWEEPS = 24
"""Of a polling, over all its steps: what is far from the floor could go on for ever, and for nothing."""
NOTICED = 1e-4
"""Relative fall of the cost for which polling goes on."""
LONGEST_MOVE = 0.5
"""Of a log-parameter in one iteration."""
HOPELESS = 1e6
"""What a residual that is not finite counts, in sigma."""


class SimulationError:
    """A free run held against its record, over the coordinates of some parameters."""

    def __init__(
        self, run: FreeRun, composition: Composition, parameters: tuple[Parameter, ...], theta: Vector
    ) -> None:
        record = run.record
        self._composition = composition
        self.parameters = parameters
        self.run = run
        simulated = np.zeros(len(record), dtype=np.bool_)
        for first, end in record.segments:
            simulated[first:end] = True
        self._rows = np.flatnonzero(simulated & record.judged)
        self._measured_m = record.position_m[self._rows]
        self.sigma_m = record.noise_m or 1e-6 * composition.valve.stroke_m
        self._theta = np.array(theta)
        self._costs: dict[tuple[bytes, float], float] = {}
        bounds = np.array([each.bounds for each in parameters]).reshape(-1, 2)
        self.lower, self.upper = bounds[:, 0], bounds[:, 1]

    @cached_property
    def rough(self) -> "SimulationError":
        """The same over a simulation of longer steps."""
        run = FreeRun(self._composition, self.run.record, from_pressure=self.run.from_pressure, accuracy=ROUGH)
        return SimulationError(run, self._composition, self.parameters, self._theta)

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
        """Return the soft-L1 cost, half a sum of squares for small residuals; once worked out it is kept."""
        key = (z.tobytes(), scale)
        if key not in self._costs:
            self._costs[key] = soft(self.residuals(z), scale)
        return self._costs[key]

    def alike(self, z: Vector, other: Vector, scale: float = FINAL) -> bool:
        """Whether two places fit equally well: their costs differ by less than one unit of BIC, n log(C_1 / C_2)."""
        costs = self.cost(z, scale), self.cost(other, scale)
        return self.count * (max(costs) - min(costs)) < max(costs)

    def screened(self, pool: Iterable[Vector], count: int) -> list[Vector]:
        """Return the best of a pool, by the middling scale's cost of the rough simulation."""
        return sorted(pool, key=lambda z: self.rough.cost(z, MIDDLE.scale))[:count]

    def rms_m(self, z: Vector) -> float:
        """Return the plain rms error, m."""
        return self.sigma_m * float(np.sqrt(np.mean(self.residuals(z) ** 2)))

    def jacobian(self, z: Vector, here: Vector, step: float) -> NDArray[np.float64]:
        """Return dr/dz at z, where r is `here`: (judged samples, parameters).

        By differences of that step, forward but for the upper bound.
        """
        columns = []
        for i in range(z.size):
            there = z.copy()
            there[i] += step if z[i] + step <= self.upper[i] else -step
            columns.append((self.residuals(there) - here) / (there[i] - z[i]))
        return np.array(columns).T

    def descended(self, z: Vector) -> Vector:
        """Go down from z through all levels."""
        for level in (WIDE, MIDDLE, NARROW):
            z = self.descended_at(level, z)
        return z

    def descended_at(self, level: Level, z: Vector) -> Vector:
        """Go down from z at one level: Levenberg's and Marquardt's, weighted by 1 / sqrt(1 + (r / s)^2)."""
        damping = 1e-3
        residuals = self.residuals(z)
        cost = soft(residuals, level.scale)
        for _ in range(MOST_ITERATIONS):
            weights = 1.0 / np.sqrt(1.0 + (residuals / level.scale) ** 2)
            J = self.jacobian(z, residuals, level.difference)
            gradient = J.T @ (weights * residuals)
            curvature = (J.T * weights) @ J
            ridge = np.diag(np.maximum(np.diag(curvature), 1e-9))
            before = cost
            for _ in range(MOST_DAMPINGS):
                move = np.linalg.solve(curvature + damping * ridge, -gradient)
                there = np.clip(z + np.clip(move, -LONGEST_MOVE, LONGEST_MOVE), self.lower, self.upper)
                tried = self.residuals(there)
                if soft(tried, level.scale) < cost:
                    z, residuals, cost = there, tried, soft(tried, level.scale)
                    damping *= 0.2
                    break
                damping *= 6.0
            if cost > before * (1.0 - level.enough):
                return z
        return z

    def polled(self, z: Vector, steps: Sequence[float] = POLLS, scale: float = FINAL) -> Vector:
        """Try each direction both ways by falling steps until none helps.

        The directions are the coordinates and the eigenvectors of J'J, which follow the valleys.
        """
        best = self.cost(z, scale)
        J = self.jacobian(z, self.residuals(z), WIDE.difference)
        _, vectors = np.linalg.eigh(J.T @ J)
        ways = [*np.eye(z.size), *(vectors / np.max(np.abs(vectors), axis=0)).T]
        sweeps = iter(range(MOST_SWEEPS))
        for step in steps:
            for _ in sweeps:
                before = best
                for way in (sign * step * each for each in ways for sign in (1.0, -1.0)):
                    there = np.clip(z + way, self.lower, self.upper)
                    cost = self.cost(there, scale)
                    if cost < best * (1.0 - NOTICED):
                        z, best = there, cost
                if best == before:
                    break
        return z


def root_weights(residuals: Vector, scale: float) -> Vector:
    """Return by what residuals and derivatives are multiplied so that least squares go down the soft-L1 cost."""
    return np.asarray((1.0 + (residuals / scale) ** 2) ** -0.25)


def soft(residuals: Vector, scale: float) -> float:
    """Return the soft-L1 cost."""
    return float(scale**2 * np.sum(np.sqrt(1.0 + (residuals / scale) ** 2) - 1.0))

"""The error of a free run as a function of the free coordinates.

    r_i = (simulated_i - measured_i) / sigma,    cost_s = sum s^2 (sqrt(1 + (r_i / s)^2) - 1)       soft L1 of scale s

The wide scales do with a simulation of longer steps, and fewer rows (`rough`); what is compared in the end is always
the fine one.
"""

from collections.abc import Iterable
from functools import cached_property
from math import inf
from operator import itemgetter

import numpy as np
from numpy.typing import NDArray

from sim.composition import Composition
from sim.karnopp import Vector
from sim.misfit import Judge
from workbench.fit.breaking_off import go_on
from workbench.model.free_run import FINE, ROUGH, SCOUTING, Accuracy, FreeRun
from workbench.model.multiple_shooting import MultipleShooting
from workbench.model.parameters import Parameter
from workbench.model.thinning import thinned

FINAL, MIDDLE = 5.0, 30.0
"""Scales, in sigma: of the cost by which fits are compared, and of that by which starts are chosen."""
WITHIN = 1.01
"""Factor on the least cost up to which a search has come to it."""
HOPELESS = 1e3
"""What a residual that is not finite counts, in strokes. However smooth the sensor, less than that is told apart."""
INSIDE, SHARPER = 0.49, 0.1
"""Of a quantum: what is well inside its half; of the noise: how far outside counts, where a sensor rounds."""


class SimulationError:
    """A free run held against its record, over the coordinates of some parameters."""

    def __init__(
        self, run: FreeRun, composition: Composition, parameters: tuple[Parameter, ...], theta: Vector
    ) -> None:
        record = run.record
        self.composition = composition
        self.parameters = parameters
        self.run = run
        rows = np.flatnonzero(run.judged & record.valid)
        self.count = rows.size
        """Number of valid samples."""
        self.rows = rows
        """Of the record that are judged, (count,)."""
        whole = rows.size == len(record)
        self._rows = slice(None) if whole else rows
        self._measured_m = np.full(len(record), np.nan)
        self._measured_m[rows] = record.position_m[rows]
        self.sigma_m = record.scale_m or 1e-6 * composition.valve.stroke_m
        self._unit_m, self._inside_m = self.sigma_m, 0.0
        self._hopeless_m = HOPELESS * composition.valve.stroke_m
        self._theta = np.array(theta)
        self._costs: dict[tuple[bytes, float], float] = {}
        bounds = np.array([each.bounds for each in parameters]).reshape(-1, 2)
        self.lower, self.upper = bounds[:, 0], bounds[:, 1]

    @cached_property
    def rough(self) -> "SimulationError":
        """The same over a simulation of longer steps, by fewer rows; itself where steps are of a sample."""
        return self._coarser(ROUGH)

    @cached_property
    def scouting(self) -> "SimulationError":
        """The same over one of steps longer still, where many valves are tried from afar."""
        return self._coarser(SCOUTING)

    def _coarser(self, accuracy: Accuracy) -> "SimulationError":
        if self.run.by.slow:
            return self
        record = thinned(self.run.record, self.composition.valve)
        run = FreeRun(self.composition, record, from_pressure=self.run.from_pressure, accuracy=accuracy, by=self.run.by)
        return self.over(run)

    def by_slips(self, accuracy: Accuracy = FINE, part: int | None = None) -> "SimulationError":
        """Return the error by multiple shooting; with `part` 0 or 1, of every other slip or those between."""
        run = MultipleShooting(
            self.composition,
            self.run.record,
            from_pressure=self.run.from_pressure,
            accuracy=accuracy,
            by=self.run.by,
            part=part,
        )
        return self.over(run)

    def over(self, run: FreeRun) -> "SimulationError":
        """Return the error of another run over the same coordinates."""
        return SimulationError(run, self.composition, self.parameters, self._theta)

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

    def compared(self, z: Vector, scale: float, limit: float) -> tuple[Vector, float]:
        """Return r, one a valid sample, and what they cost by a scale; r is not whole where that is the limit."""
        go_on()
        judge = Judge(self._unit_m, self._inside_m, self._hopeless_m, scale, limit)
        errors, cost = self.run.misfit(self.simulated(z), self._measured_m, judge)
        return errors[self._rows], cost

    def simulated(self, z: Vector) -> Vector:
        """Return the parameter vector that is simulated for z."""
        return self.theta(z)

    def residuals(self, z: Vector, scale: float = FINAL) -> Vector:
        """Return r, one a valid sample; what they cost by a scale is kept."""
        errors, cost = self.compared(z, scale, inf)
        self._costs[z.tobytes(), scale] = cost
        return errors

    def cost(self, z: Vector, scale: float = FINAL) -> float:
        """Return the soft-L1 cost, half a sum of squares for small residuals; once worked out it is kept."""
        return self.cost_below(z, inf, scale)

    def cost_below(self, z: Vector, limit: float, scale: float = FINAL) -> float:
        """Return the cost where it is below a limit, else infinity; a run that has come to the limit is given up."""
        key = (z.tobytes(), scale)
        if key not in self._costs:
            _, cost = self.compared(z, scale, limit)
            if cost >= limit:
                return inf
            self._costs[key] = cost
        return self._costs[key] if self._costs[key] < limit else inf

    def least(self, places: Iterable[Vector], scale: float = FINAL) -> Vector:
        """Return the first of the places where the cost is least."""
        (best,) = self._best(places, 1, scale)
        return best

    def _best(self, places: Iterable[Vector], count: int, scale: float) -> list[Vector]:
        """Return the places of least cost, best first; of equal ones the first."""
        best: list[tuple[float, Vector]] = []
        for z in places:
            limit = best[-1][0] if len(best) == count else inf
            cost = self.cost_below(z, limit, scale)
            if cost < limit:
                best = sorted([*best, (cost, z)], key=itemgetter(0))[:count]
        return [z for _, z in best]

    def screened(self, pool: Iterable[Vector], count: int) -> list[Vector]:
        """Return the best of a pool, by the middling scale's cost of the rough simulation."""
        return self.rough._best(pool, count, MIDDLE)

    def rms_m(self, z: Vector) -> float:
        """Return the plain rms error, m."""
        return self.sigma_m * float(np.sqrt(np.mean(self.residuals(z) ** 2)))

    def jacobian(self, z: Vector, here: Vector, step: float) -> NDArray[np.float64]:
        """Return dr/dz at z, where r is `here`: (valid samples, parameters).

        By differences of that step, forward but for the upper bound.
        """
        columns = []
        for i in range(z.size):
            there = z.copy()
            there[i] += step if z[i] + step <= self.upper[i] else -step
            columns.append((self.residuals(there) - here) / (there[i] - z[i]))
        return np.array(columns).T


class Unrounded(SimulationError):
    """The error of a sensor that rounds, by how far the position lies outside the quantum that was indicated.

    r_i = max(0, |x_i - q n_i| - 0.49 q) sign(x_i - q n_i) / (sigma / 10)     x_i simulated before rounding, n_i the
                                                                              measured in quanta, rounded

    Rounded positions are right or wrong by a whole quantum, and nothing says which way to go; this does. The quantum
    itself stays as it is at z: a wider one is never wrong. What lies just outside is as wrong as what lies far, hence
    the sharper sigma and the margin.
    """

    def __init__(self, error: SimulationError, quantum: Parameter, z: Vector, inside: float = INSIDE) -> None:
        theta = error.theta(z)
        super().__init__(error.run, error.composition, error.parameters, theta)
        self._index = quantum.index
        quantum_m = float(theta[quantum.index])
        self._measured_m = quantum_m * np.round(self._measured_m / quantum_m)
        self._unit_m, self._inside_m = SHARPER * self.sigma_m, inside * quantum_m

    def simulated(self, z: Vector) -> Vector:
        """Return the parameter vector at z without rounding."""
        theta = self.theta(z)
        theta[self._index] = 0.0
        return theta


def smoothed(error: SimulationError, z: Vector, inside: float = INSIDE) -> SimulationError:
    """Return the error itself, or where a sensor rounds at z, that of the position before it is rounded.

    Args:
        error: of what is indicated.
        z: where the quantum is taken from.
        inside: share of the quantum by which a position may lie off.
    """
    theta = error.theta(z)
    for each in error.parameters:
        if each.guess == "quantum" and theta[each.index] > 0.0:
            return Unrounded(error, each, z, inside)
    return error


def root_weights(residuals: Vector, scale: float) -> Vector:
    """Return by what residuals and derivatives are multiplied so that least squares go down the soft-L1 cost."""
    return np.asarray((1.0 + (residuals / scale) ** 2) ** -0.25)


def softs(residuals: Vector, scale: float) -> Vector:
    """Return what each residual adds to the soft-L1 cost."""
    roots = residuals / scale
    roots *= roots
    roots += 1.0
    np.sqrt(roots, out=roots)
    roots -= 1.0
    roots *= scale**2
    return np.asarray(roots)


def soft(residuals: Vector, scale: float) -> float:
    """Return the soft-L1 cost."""
    return float(np.sum(softs(residuals, scale)))

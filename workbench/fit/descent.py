"""The descent from one start to the least error in reach: a trust region at falling scales, then a scan of the stairs.

The cost is a staircase: a slip happens or does not. So the scale of the soft-L1 loss falls, 100, 30, 5 sigma, and with
it the step of the forward differences, 1e-3, 3e-4, 1e-4 of a log-parameter: large errors are first bounded, then
resolved. The minimiser is scipy's trust region reflective, in a box round its start.

What is left are stairs that no derivative sees: a break-away one sample early or late. Each coordinate is scanned to
either side over five hundredths, the lowest step taken and the descent begun again there, until the parameters stay.

Where a sensor rounds, all of this is done by the position before rounding first: rounded ones show no way down.
"""

from collections.abc import Sequence
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from sim.karnopp import Vector
from workbench.fit.objective import FINAL, MIDDLE, WITHIN, SimulationError, smoothed


class Stage(NamedTuple):
    """A stage of the descent."""

    scale: float
    """Of the soft-L1 loss, in sigma."""
    difference: float
    """Step of the forward differences."""
    tolerance: float
    """Relative fall of the cost, and of a move, at which it ends."""
    evaluations: int
    """Most, derivatives not counted."""


WIDE, MIDDLING = Stage(100.0, 1e-3, 1e-2, 12), Stage(MIDDLE, 3e-4, 1e-3, 12)
COARSE, NARROW = Stage(FINAL, 1e-3, 1e-5, 20), Stage(FINAL, 1e-4, 1e-6, 20)
"""The last stages: the valleys are bent at the bottom, and too wide for the narrow differences alone."""
REACH = 1.0
"""Half-width of the box round a stage's start, of a log-parameter."""
GRADIENT = 1e-9
"""Of the cost by a log-parameter: less is none, and no direction to go."""
STAIRS = np.geomspace(2e-4, 5e-2, 10)
ROUNDS = 4
SETTLED = 1e-3
"""Relative fall of the cost by a scan below which the search has ended."""
BY_STAIRS = 1.5
"""Factor on the cost that stairs may make."""


def descended_through(error: SimulationError, z: Vector, stages: Sequence[Stage] = (WIDE, MIDDLING, NARROW)) -> Vector:
    """Return the coordinates of the least that stages, one after the other, reach from z, without a scan."""
    for stage in stages:
        z = descended(error, z, stage)
    return z


def descended(error: SimulationError, z: Vector, stage: Stage) -> Vector:
    """Return the coordinates, (parameters,), of the least that a stage reaches from z."""
    lower, upper = np.maximum(error.lower, z - REACH), np.minimum(error.upper, z + REACH)
    latest: tuple[bytes, Vector] = b"", z

    def residuals(there: Vector) -> Vector:
        nonlocal latest
        if latest[0] != there.tobytes():
            latest = there.tobytes(), error.residuals(there, stage.scale)
        return latest[1]

    def jacobian(there: Vector) -> NDArray[np.float64]:
        return error.jacobian(there, residuals(there), stage.difference)

    found = least_squares(
        residuals,
        z,
        jac=jacobian,
        bounds=(lower, upper),
        loss="soft_l1",
        f_scale=stage.scale,
        x_scale="jac",
        ftol=stage.tolerance,
        xtol=1e-2 * stage.tolerance,
        gtol=GRADIENT,
        max_nfev=stage.evaluations,
    )
    there = np.clip(np.asarray(found.x, np.float64), error.lower, error.upper)
    return there if error.cost(there, stage.scale) < error.cost(z, stage.scale) else z


def settled(error: SimulationError, z: Vector, base: float = inf) -> Vector:
    """Return the coordinates of the least in reach of z at the final scale: neither descent nor stairs go lower.

    Args:
        error: what is lowered.
        z: where it begins, (parameters,).
        base: the cost of a search that is there already. What has come to that, or lies above it by more than stairs
            make, is not scanned: it need not be the best of its kind.
    """
    smooth = smoothed(error, z)
    if smooth is not error:
        # At the wider scale first: a slip mistimed by a stair outweighs there what is little outside its quantum.
        there = _scanned_each(smooth, descended(smooth, z, MIDDLING), MIDDLE)
        z = min(z, _at_rest(smooth, there), key=error.cost)
    return _at_rest(error, z, base)


def _at_rest(error: SimulationError, z: Vector, base: float = inf) -> Vector:
    """Return where descents and scans by turns leave z as it is."""
    for _ in range(ROUNDS):
        z = descended_through(error, z, (COARSE, NARROW))
        at_rest = error.cost(z)
        if at_rest > BY_STAIRS * base or base / WITHIN < at_rest < WITHIN * base:
            break
        z = _scanned_each(error, z, FINAL)
        if error.cost(z) > at_rest * (1.0 - SETTLED):
            break
    return z


def _scanned_each(error: SimulationError, z: Vector, scale: float) -> Vector:
    for i in range(z.size):
        z = scanned(error, z, i, scale=scale)
    return z


def scanned(error: SimulationError, z: Vector, i: int, distances: Vector = STAIRS, scale: float = FINAL) -> Vector:
    """Return z with the i-th coordinate moved to the lowest of the stairs about it, at these distances either way."""
    places = [z]
    for way in (*distances, *-distances):
        there = z.copy()
        there[i] = np.clip(z[i] + way, error.lower[i], error.upper[i])
        places.append(there)
    return error.least(places, scale)

"""The last of a search: places strewn about its end, gone over to whichever is lower.

    z' = z + 10^u s w      u uniform in -1.5 to 1.5, s deviations by `uncertainty.deviations`, w standard normal, each
                           coordinate its own; in every other static friction moves by 10^t w more, t in -4 to -1.7
    z' = z + 10^u V S w    every third: S deviations along the axes V of the valley, whose floor all coordinates follow

In every fourth about half of the coordinates stay.

Static friction shows in the instants of break-aways alone: its derivative says nothing.

The stairs of a record run across all coordinates at once: a scan of each alone ends on one, as does a descent. Where a
sensor rounds, searches of several origins may end on the same one: before they are believed, places about the best are
crossed with each other by scipy's differential evolution, which needs no derivative.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

from sim.composition import STATIC
from sim.karnopp import Vector
from workbench.fit.agreement import Place
from workbench.fit.descent import scanned
from workbench.fit.objective import SimulationError
from workbench.fit.uncertainty import along_axes, of_coordinates

STREWN, CROSSED, TURNS = 400, 40, 60
"""Places about each end; those about the best of all, and how often they are crossed with each other."""
WIDELY = 20.0
"""Deviations of these."""
MOST_PROVED, LOWER = 4, 1.002
"""How often more, at most; by what factor lower it must lead to be made again."""
NEAREST, FARTHEST = -1.5, 1.5
"""Of the decimal logarithm of the distance, in deviations."""
SURE, UNSURE = 1e-5, 3e-3
"""Least and most of a deviation, of a log-parameter: on stairs the derivatives may say anything."""
UNSURE_ALONG = 3e-2
"""The same along an axis, where a step is right for all coordinates or for none."""
STATIC_NEAREST, STATIC_FARTHEST = -4.0, -1.7

TREADS = np.geomspace(1e-4, 0.15, 150)
"""Distances at which static friction is tried: each 5 % farther than the last."""


def on_lowest_tread(error: SimulationError, z: Vector) -> Vector:
    """Return z with static friction on the lowest of the stairs about it: of some the treads are very narrow."""
    static = [i for i, each in enumerate(error.parameters) if each.index == STATIC]
    return scanned(error, z, static[0], TREADS) if static else z


def strewn(error: SimulationError, z: Vector, count: int = STREWN) -> Vector:
    """Return the lowest of so many places about z, which itself decides what is drawn: no two ends draw the same."""
    generator = np.random.default_rng(z.view(np.uint32))
    deviation, along, axes = _spread(error, z)
    static = np.array([each.index == STATIC for each in error.parameters] or np.zeros(z.size), np.float64)
    for i in range(count):
        far = 10.0 ** generator.uniform(NEAREST, FARTHEST)
        stair = 10.0 ** generator.uniform(STATIC_NEAREST, STATIC_FARTHEST) * static
        w = generator.standard_normal(z.size)
        if i % 4 == 3:
            w *= generator.random(z.size) < 0.5
        way = far * axes @ (along * w) if i % 3 == 2 else (far * deviation + i % 2 * stair) * w
        z = error.least((z, np.clip(z + way, error.lower, error.upper)))
    return z


def evolved(error: SimulationError, z: Vector) -> Vector:
    """Return the lowest place that differential evolution comes to from z and others about it, which z decides."""
    generator = np.random.default_rng(z.view(np.uint32))
    deviation, along, axes = _spread(error, z)
    normal = generator.standard_normal((CROSSED - 1, z.size))
    normal[::2], normal[1::2] = deviation * normal[::2], along * normal[1::2] @ axes.T
    reach = 10.0 * WIDELY * deviation
    lower, upper = np.maximum(error.lower, z - reach), np.minimum(error.upper, z + reach)
    found = differential_evolution(
        error.cost,
        Bounds(lower, upper),
        init=np.clip(np.vstack([z, z + WIDELY * normal]), lower, upper),
        maxiter=TURNS,
        tol=0.0,
        mutation=(0.3, 1.0),
        recombination=0.9,
        polish=False,
        rng=generator,
    )
    return min(z, np.asarray(found.x, np.float64), key=error.cost)


def _spread(error: SimulationError, z: Vector) -> tuple[Vector, Vector, NDArray[np.float64]]:
    """Return s of the coordinates and S along the axes, inside what is believed of either, and the axes V."""
    along, axes = along_axes(error, z)
    return np.clip(of_coordinates(along, axes), SURE, UNSURE), np.clip(along, SURE, UNSURE_ALONG), axes


def while_lower(error: SimulationError, z: Vector, move: Callable[[Vector], Vector], most: int) -> Vector:
    """Return where a move leads from z, made once, then so many times at most, as long as it leads clearly lower."""
    before, here = z, move(z)
    for _ in range(most):
        if error.cost(before) <= LOWER * error.cost(here):
            break
        before, here = here, move(here)
    return here


def proved(error: SimulationError, ends: Sequence[Place]) -> tuple[Place, ...]:
    """Return the ends, best first, with the first moved to the lowest place about it.

    Where that is lower by more than searches may differ, the others do not agree with it any more.
    """

    def off_stairs(z: Vector) -> Vector:
        return strewn(error, evolved(error, on_lowest_tread(error, z)))

    best, *others = ends
    return replace(best, z=while_lower(error, best.z, off_stairs, MOST_PROVED)), *others

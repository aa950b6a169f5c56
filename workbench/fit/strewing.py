"""The last of a search: places strewn about its end, gone over to whichever is lower.

    z' = z + 10^u s w      u uniform in -1.5 to 1.5, s deviations by `uncertainty.deviations`, w standard normal, each
                           coordinate its own; in every other static friction moves by 10^t w more, t in -4 to -1.7
    z' = z + 10^u V S w    every third: S deviations along the axes V of the valley, whose floor all coordinates follow

In every fourth about half of the coordinates stay.

Static friction shows in the instants of break-aways alone: its derivative says nothing.

The stairs of a record run across all coordinates at once: a scan of each alone ends on one, as does a descent.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sim.composition import STATIC
from sim.karnopp import Vector
from workbench.fit.descent import scanned
from workbench.fit.objective import SimulationError
from workbench.fit.uncertainty import along_axes, of_coordinates

STREWN = 400
"""Places about an end."""
LOWER = 1.002
"""By what factor lower a move must lead to be made again."""
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
    deviation, along, axes = spread(error, z)
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


def spread(error: SimulationError, z: Vector) -> tuple[Vector, Vector, NDArray[np.float64]]:
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

"""Places that evolve, by scipy's differential evolution, which needs no derivative: about an end, and from afar.

    z' = z + 20 s w, z + 20 V S w      about an end: s deviations by `uncertainty.deviations`, S those along the axes V
                                       of the valley, w standard normal; compared by the cost
    z' = z + d                         from afar: springs and Coulomb friction, which the landings tell, near; all else
                                       from where it may be; compared by a rough simulation at the wide scale

About an end they come off stairs that run across all coordinates at once. Where a sensor rounds, a single position in a
wrong quantum outweighs all else, and the error does not tell how far outside of it: that is what they are compared by
there. From afar they cross what lies between two valleys where slips stay mistimed: what moves these, viscous and
static friction and what an effect has of its own, is off together. There the lowest must not lead the others, as it is
the valley that is to be left.
"""

from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution

from sim.composition import COULOMB, SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.fit.descent import WIDE
from workbench.fit.objective import SimulationError
from workbench.fit.strewing import spread

WIDELY = 20.0
"""Deviations about an end by which places are off,"""
REACH = 200.0
"""and to which they evolve at most."""
DRAWN, TURNS, LEADING = 150, 60, 4
"""Places from afar; how often they are crossed with each other; and how many lead on."""
NEAR = {SPRING: 0.003, COULOMB: 0.01}
"""Standard deviation of what landings tell, of the logarithm;"""
FROM_AFAR = {VISCOUS: 1.5, STATIC: 0.2}
"""what they do not tell is drawn as far off at most;"""
FARTHEST = 3.0
"""to which all of them evolve at most, if they are not drawn farther off;"""
ABOUT = 0.3
"""standard deviation of an effect's own in half of the places; in the others it is drawn from its strengths' range."""

Generator = np.random.Generator
Places = NDArray[np.float64]


def evolved(error: SimulationError, z: Vector, places: int, turns: int) -> Vector:
    """Return the lowest place that so many evolve to from z and about it, in so many turns; z decides what is drawn."""
    begins, lower, upper, generator = _about(error, z, places)
    return min(z, _evolved(error.cost, begins, lower, upper, "best1bin", turns, generator)[0], key=error.cost)


def evolved_inside(error: SimulationError, unrounded: SimulationError, z: Vector, places: int, turns: int) -> Vector:
    """Return the lowest place that evolves from z and about it where a sensor rounds, by what lies outside its quanta.

    The quantum itself stays: a wider one would hold all positions.
    """
    begins, lower, upper, generator = _about(error, z, places)
    for i in (i for i, each in enumerate(error.parameters) if each.guess == "quantum"):
        begins[:, i] = lower[i] = upper[i] = z[i]
    found = _evolved(unrounded.cost, begins, lower, upper, "best1bin", turns, generator)
    return min([z, *found], key=error.cost)


def evolved_from_afar(error: SimulationError, z: Vector, strengths: Sequence[Sequence[Vector]]) -> list[Vector]:
    """Return where places drawn about z from afar evolve to, the best first; z decides what is drawn.

    Args:
        error: over whose rough simulation they are compared.
        z: about which they are drawn.
        strengths: coordinates of each strength of what is added, which span from where its parameters are drawn.
    """
    generator = np.random.default_rng(z.view(np.uint32))
    begins = _drawn(generator, error, z, strengths)
    lower = np.minimum(np.maximum(error.lower, z - FARTHEST), begins.min(axis=0))
    upper = np.maximum(np.minimum(error.upper, z + FARTHEST), begins.max(axis=0))
    rough = error.rough
    found = _evolved(lambda there: rough.cost(there, WIDE.scale), begins, lower, upper, "rand1bin", TURNS, generator)
    return list(found[:LEADING])


def _about(error: SimulationError, z: Vector, places: int) -> tuple[Places, Vector, Vector, Generator]:
    """Return z and places about it, (places, parameters), their bounds, and what draws on."""
    generator = np.random.default_rng(z.view(np.uint32))
    deviation, along, axes = spread(error, z)
    normal = generator.standard_normal((places - 1, z.size))
    normal[::2], normal[1::2] = deviation * normal[::2], along * normal[1::2] @ axes.T
    lower, upper = np.maximum(error.lower, z - REACH * deviation), np.minimum(error.upper, z + REACH * deviation)
    return np.clip(np.vstack([z, z + WIDELY * normal]), lower, upper), lower, upper, generator


def _evolved(
    cost: Callable[[Vector], float],
    begins: Places,
    lower: Vector,
    upper: Vector,
    strategy: Literal["best1bin", "rand1bin"],
    turns: int,
    generator: Generator,
) -> Places:
    """Return where places, (places, parameters), evolve to between two bounds, the best first."""
    found = differential_evolution(
        cost,
        Bounds(lower, upper),
        init=begins,
        strategy=strategy,
        maxiter=turns,
        tol=0.0,
        mutation=(0.3, 1.0),
        recombination=0.9,
        polish=False,
        rng=generator,
    )
    return np.asarray(found.population, np.float64)[np.argsort(found.population_energies, kind="stable")]


def _drawn(generator: Generator, error: SimulationError, z: Vector, strengths: Sequence[Sequence[Vector]]) -> Places:
    """Return places about z, (places, parameters), inside the bounds: what is added near in every other of them."""
    of_added = [each.index not in NEAR | FROM_AFAR for each in error.parameters]
    near = np.array([NEAR.get(each.index, 0.0) for each in error.parameters])
    far = np.array([FROM_AFAR.get(each.index, 0.0) for each in error.parameters])
    lower, upper = _span([each for values in strengths for each in values] or [z], z)
    shape = DRAWN, z.size
    places = z + near * generator.standard_normal(shape) + far * generator.uniform(-1.0, 1.0, shape)
    own = places + ABOUT * generator.standard_normal(shape)
    own[::2] = generator.uniform(lower, upper, shape)[::2]
    return np.clip(np.where(of_added, own, places), error.lower, error.upper)


def _span(values: Sequence[Vector], z: Vector) -> tuple[Vector, Vector]:
    """Return the least and the most of coordinates, and a factor of e beyond."""
    all_of_them = np.array([z, *values])
    return all_of_them.min(axis=0) - 1.0, all_of_them.max(axis=0) + 1.0

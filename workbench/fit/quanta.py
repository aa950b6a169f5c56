"""Which quantum a sensor rounds to: rests that are few look like multiples of several.

How well a quantum does shows only once all else has given way to it: the search that has come to one is settled again
with each of the others that the rests suggest, and where one of them leads lower, all ends are.

Searches of several origins may end on the same one of the stairs that rounding makes: before they are believed, places
about the best evolve.
"""

from collections.abc import Sequence
from dataclasses import replace

from sim.karnopp import Vector
from workbench.fit.agreement import Place
from workbench.fit.descent import settled
from workbench.fit.evolution import evolved, evolved_inside
from workbench.fit.guesses import likely_quanta_m
from workbench.fit.objective import WITHIN, SimulationError, smoothed
from workbench.fit.strewing import on_lowest_tread, strewn, while_lower

EVOLVING, TURNS, MOST = 60, 120, 4
"""Places about the best end, how often they are crossed with each other, and how often all of it is made more."""
HALF = 0.5
"""Of a quantum: a position that is rounded lies off by that at most."""


def with_best_quantum(error: SimulationError, ends: Sequence[Place]) -> Sequence[Place]:
    """Return the ends, best first, settled again with the quantum that leads lowest from the best of them.

    Args:
        error: by whose cost they are compared.
        ends: of searches with an effect that rounds.
    """
    best = ends[0].z
    tried = [settled(error, _rounded_to(error, best, each)) for each in likely_quanta_m(error.run.record)]
    lowest = min([best, *tried], key=error.cost)
    if error.cost(best) <= WITHIN * error.cost(lowest):
        return ends
    quantum_m = next(error.theta(lowest)[each.index] for each in error.parameters if each.guess == "quantum")
    others = [replace(each, z=settled(error, _rounded_to(error, each.z, quantum_m))) for each in ends[1:]]
    return sorted([replace(ends[0], z=lowest), *others], key=lambda end: error.cost(end.z))


def proved(error: SimulationError, ends: Sequence[Place]) -> tuple[Place, ...]:
    """Return the ends, best first, with the first moved to the lowest place about it.

    Where that is lower by more than searches may differ, the others do not agree with it any more.
    """

    def off_stairs(z: Vector) -> Vector:
        z = evolved_inside(error, smoothed(error, z, HALF), z, EVOLVING, TURNS)
        return strewn(error, evolved(error, on_lowest_tread(error, z), EVOLVING, TURNS))

    best, *others = ends
    return replace(best, z=while_lower(error, best.z, off_stairs, MOST)), *others


def _rounded_to(error: SimulationError, z: Vector, quantum_m: float) -> Vector:
    """Return z with another quantum."""
    theta = error.theta(z)
    theta[[each.index for each in error.parameters if each.guess == "quantum"]] = quantum_m
    return error.coordinates(theta)

"""Which quantum a sensor rounds to: rests that are few look like multiples of several.

How well a quantum does shows only once all else has given way to it: the search that has come to one is settled again
with each of the others that the rests suggest, and where one of them leads lower, all ends are.
"""

from collections.abc import Sequence
from dataclasses import replace

from sim.karnopp import Vector
from workbench.fit.agreement import Place
from workbench.fit.descent import settled
from workbench.fit.guesses import likely_quanta_m
from workbench.fit.objective import WITHIN, SimulationError


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


def _rounded_to(error: SimulationError, z: Vector, quantum_m: float) -> Vector:
    """Return z with another quantum."""
    theta = error.theta(z)
    theta[[each.index for each in error.parameters if each.guess == "quantum"]] = quantum_m
    return error.coordinates(theta)

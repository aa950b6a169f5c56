"""Which searches came to the same: agreement in cost and in parameters, from starts that have nothing in common.

    C(z) <= 1.01 C(z_best)
    |z_i - z_best,i| <= max(2 s_i, 0.01)      of every coordinate that the record determines, s_i <= 1

    s_i^2 = sum_k kappa v_ki^2 / lambda_k     J' W J v_k = lambda_k v_k at the best, kappa as in `uncertainty`

A coordinate whose standard deviation s_i exceeds a factor of e is not determined, alone or because it may change
together with others: searches may leave it anywhere, and agree by their cost.

Where a search began is its origin. Searches of one origin, strengths of an effect added to the same base fit, say,
share what may be wrong in it: they count as one. So does a search by all slips beside those by halves of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim.karnopp import Vector
from workbench.fit.objective import WITHIN, SimulationError
from workbench.fit.uncertainty import deviations

SHARED = "slips"
"""Origin of a search by all slips, whose measurements those by halves share."""
HALVES = frozenset({"even slips", "odd slips"})
DEVIATIONS, NEAR = 2.0, 0.01
DETERMINED = 1.0
"""Standard deviation of a coordinate, a factor of e, up to which the record determines it."""


@dataclass(frozen=True, slots=True)
class Place:
    """Coordinates where a search begins or has come to, (parameters,), and the origin that it shares with others."""

    z: Vector
    origin: str


def agreeing(error: SimulationError, ends: Sequence[Place]) -> int:
    """Return from how many origins searches came to the best of their ends, its own counted.

    Args:
        error: by whose cost the ends are compared.
        ends: where searches ended.
    """
    best = min(ends, key=lambda end: error.cost(end.z))
    deviation = deviations(error, best.z)
    compared = deviation <= DETERMINED
    allowed = np.maximum(DEVIATIONS * deviation[compared], NEAR)

    def agrees(end: Place) -> bool:
        near = np.abs(end.z - best.z)[compared] <= allowed
        return error.cost(end.z) <= WITHIN * error.cost(best.z) and bool(near.all())

    origins = {end.origin for end in ends if agrees(end)}
    return len(origins - {SHARED} if origins & HALVES else origins)

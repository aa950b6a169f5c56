"""Places between the ends of searches and beyond the best: what ends differ by lies along the valley they all came to.

    z' = z_0 + f (z_e - z_0)          z_0 the best end, z_e the next ones, f = 1/2, -1/2, -2

A valley may be so narrow, and its walls such stairs, that no derivative at its floor points along it; searches from
elsewhere end in it farther up or down. This is the move of differential evolution, but for what follows: each place is
brought down to the floor again.
"""

from collections.abc import Sequence

import numpy as np

from sim.karnopp import Vector
from workbench.fit.objective import SimulationError

PARTNERS, MOST = 3, 8
"""Ends besides the best that are crossed with it; of those that are there so many are kept."""
BETWEEN, BEYOND = 0.5, (-0.5, -2.0)
"""f"""


def crossed(error: SimulationError, ends: Sequence[Vector]) -> list[Vector]:
    """Return the places between the first of the ends, the best, and the next ones, and beyond it."""
    best = ends[0]
    return [
        np.asarray(np.clip(best + f * (other - best), error.lower, error.upper))
        for other in ends[1 : 1 + PARTNERS]
        for f in (BETWEEN, *BEYOND)
    ]

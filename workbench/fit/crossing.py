"""Places between the ends of searches and beyond the best: what ends differ by lies along the valley of all.

    z' = z_0 + f (z_e - z_0)          z_0 the best end, z_e the next ones, f = 1/2, -1/2, -2
    z' = z_0 ± (z_d - z_e)            each two of those

A valley may be so narrow, and its walls such stairs, that no derivative at its floor points along it; searches from
elsewhere end in it farther up or down. This is the move of differential evolution, but for what follows: each place is
brought down to the floor again. Ends that have come to the same lead nowhere: of these one counts.

There is nothing to go on for where what is left is noise: it does not go on from one sample to the next,
r_1 < d/sqrt(n), and none lies apart, as do those of a slip that comes a sample late, with Phi(-d) of its largest. Nor
is there where a valve scatters, and no more is left than it differs by from itself.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.special import ndtr, ndtri

from sim.composition import STATIC
from sim.karnopp import Vector
from workbench.fit.objective import SimulationError

PARTNERS, MOST = 3, 8
"""Ends besides the best that are crossed with it; of those that are there so many are kept."""
BETWEEN, BEYOND, BESIDE = 0.5, (-0.5, -2.0), (1.0, -1.0)
"""f"""
FAR = np.array([0.01, 0.03, 0.06, 0.12])
"""Of log(F_s/F_c): to treads that none of the ends is on."""
EASILY, SURELY = 1.0, 3.0
"""Deviations by which noise is taken for more one in three times, so that a search goes on in vain; and hardly ever."""
SCATTERS = 2.0
"""Noises from which on it counts by how much a valve repeats itself."""
ALIKE = 1e-4
"""By how much two ends differ at most, in each coordinate, that have come to the same."""


def sticking(error: SimulationError, z: Vector) -> list[Vector]:
    """Return z with static friction farther off, either way: no derivative says that all else should go along."""
    static = np.array([each.index == STATIC for each in error.parameters])
    if not static.any():
        return []
    return [np.asarray(np.clip(z + far * static, error.lower, error.upper)) for far in (*FAR, *-FAR)]


def leaves_noise(error: SimulationError, z: Vector, deviations: float = EASILY) -> bool:
    """Return whether nothing but noise is left at z, which is taken for something by so many deviations."""
    repeats_m = error.run.record.repeatability_m or 0.0
    if repeats_m > SCATTERS * error.sigma_m and error.rms_m(z) <= repeats_m:
        return True
    left = error.residuals(z)
    apart = float(ndtri(1.0 - ndtr(-deviations) / left.size))
    if float(np.abs(left).max()) > apart * max(1.0, 1.4826 * float(np.median(np.abs(left)))):
        return False
    return bool(left[1:] @ left[:-1] < deviations * (left @ left) / left.size**0.5)


def unlike(ends: Sequence[Vector]) -> list[Vector]:
    """Return the ends, best first, without those that have come to the same as a better one; at most `MOST`."""
    found: list[Vector] = []
    for end in ends:
        if len(found) < MOST and all(float(np.abs(end - other).max()) > ALIKE for other in found):
            found.append(end)
    return found


def crossed(error: SimulationError, ends: Sequence[Vector]) -> list[Vector]:
    """Return the places between the first of the ends, the best, and the next ones, beyond it, and beside it."""
    best, others = ends[0], ends[1 : 1 + PARTNERS]
    ways = [f * (other - best) for other in others for f in (BETWEEN, *BEYOND)]
    ways += [f * (one - other) for one, other in combinations(others, 2) for f in BESIDE]
    return [np.asarray(np.clip(best + way, error.lower, error.upper)) for way in ways]

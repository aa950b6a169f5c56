"""Places between the ends of searches and beyond the best: what ends differ by lies along the valley of all.

    z' = z_0 + f (z_e - z_0)          z_0 the best end, z_e the next ones, f = 1/2, -1/2, -2
    z' = z_0 ± (z_d - z_e)            each two of those

A valley may be so narrow, and its walls such stairs, that no derivative at its floor points along it; searches from
elsewhere end in it farther up or down. This is the move of differential evolution, but for what follows: each place is
brought down to the floor again. Ends that have come to the same lead nowhere: of these one counts.

    z' = z_0 + d         springs and Coulomb friction, which the landings tell, near; all else drawn from afar

Where slips stay mistimed, what moves them, viscous and static friction and what an effect has of its own, is off
together: of a thousand places drawn so, which a rough simulation screens, the best are brought down, too. So is every
strength of what is added: by the cost where it begins a strong lag is far behind, but smooths the way down.

There is nothing to go on for where what is left is noise: it does not go on from one sample to the next,
r_1 < d/sqrt(n), and none lies apart, as do those of a slip that comes a sample late, with Phi(-d) of its largest. Nor
is there where a valve scatters, and no more is left than it differs by from itself.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, differential_evolution
from scipy.special import ndtr, ndtri

from sim.composition import COULOMB, SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.fit.descent import WIDE
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
DRAWN, TURNS, BROUGHT_DOWN = 150, 60, 4
SPREAD = {SPRING: 0.003, COULOMB: 0.01}
"""Standard deviation of what landings tell, of the logarithm;"""
FROM_AFAR = {VISCOUS: 1.5, STATIC: 0.2}
"""what they do not tell is drawn as far off at most;"""
FARTHEST = 3.0
"""to which they evolve at most, if they are not drawn there;"""
ABOUT = 0.3
"""standard deviation of an effect's own in half of the places; in the others it is drawn from its strengths' range."""
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


def evolved_from_afar(error: SimulationError, z: Vector, strengths: Sequence[Sequence[Vector]]) -> list[Vector]:
    """Return the best that places drawn about z, what landings do not tell from afar, evolve to, compared roughly.

    Args:
        error: over whose rough simulation they evolve, by the cost of the wide scale.
        z: about which they are drawn; it decides what is drawn.
        strengths: coordinates of each strength of what is added, which span from where its parameters are drawn.
    """
    generator = np.random.default_rng(z.view(np.uint32))
    places = _drawn(generator, error, z, strengths)
    lower, upper = np.maximum(error.lower, z - FARTHEST), np.minimum(error.upper, z + FARTHEST)
    found = differential_evolution(
        lambda there: error.rough.cost(there, WIDE.scale),
        Bounds(np.minimum(lower, places.min(axis=0)), np.maximum(upper, places.max(axis=0))),
        init=places,
        strategy="rand1bin",
        maxiter=TURNS,
        tol=0.0,
        mutation=(0.3, 1.0),
        recombination=0.9,
        polish=False,
        rng=generator,
    )
    best = np.asarray(found.population)[np.argsort(found.population_energies)]
    return unlike(list(best))[:BROUGHT_DOWN]


def _drawn(
    generator: np.random.Generator, error: SimulationError, z: Vector, strengths: Sequence[Sequence[Vector]]
) -> NDArray[np.float64]:
    """Return places about z, (places, parameters), inside the bounds: what is added near in half of them."""
    of_added = [each.index not in SPREAD | FROM_AFAR for each in error.parameters]
    spread = np.array([SPREAD.get(each.index, 0.0) for each in error.parameters])
    uniform = np.array([FROM_AFAR.get(each.index, 0.0) for each in error.parameters])
    lower, upper = _span([each for values in strengths for each in values] or [z], z)
    shape = DRAWN, z.size
    far = uniform * generator.uniform(-1.0, 1.0, shape) * generator.uniform(0.0, 1.0, shape)
    places = z + spread * generator.standard_normal(shape) + far
    own = places + ABOUT * generator.standard_normal(shape)
    own[::2] = generator.uniform(lower, upper, shape)[::2]
    return np.clip(np.where(of_added, own, places), error.lower, error.upper)


def _span(values: Sequence[Vector], z: Vector) -> tuple[Vector, Vector]:
    """Return the least and the most of coordinates, and a factor of e beyond."""
    all_of_them = np.array([z, *values])
    return all_of_them.min(axis=0) - 1.0, all_of_them.max(axis=0) + 1.0


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

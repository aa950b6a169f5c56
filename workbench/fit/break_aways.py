"""What shows in the instants of break-aways alone, static friction and how it grows while the stem rests, say.

    C = sum_j c(l_j - F_s(j)) + sum_k c(F_s(k) - u_k),    c(d) = d / (d + 3 N), d > 0
                                                          j rests under the loads l_j that they bore, k those that were
                                                          left, under the loads u_k that they did not bear

Each break-away is a stair in all of these parameters, which a descent does not see; but C needs no simulation: a random
search may try many places, and takes the one that the break-aways contradict least.

    F_s' = F_s - (F_b(z') - F_b(z))         F_b what an effect adds to static friction, the same at each break-away

What of an effect makes up for static friction, as a Stribeck excess does, runs along a valley of these stairs, whose
floor no derivative and no straight line follows: z with it stronger or weaker, and static friction for it, does.
"""

from collections.abc import Sequence

import numpy as np

from sim.composition import BASE, COULOMB, STATIC
from sim.karnopp import Vector
from workbench.fit.landings import NOT_IN_LANDINGS, Landings, Loaded, rests
from workbench.fit.objective import SimulationError

CONTRADICTED_N = 3.0
"""Distance from a break-away's load at which the contradiction counts half."""
TRIED = 200
"""Places,"""
NEAREST, FARTHEST = -3.0, 0.0
"""of the decimal logarithm of their distance, of a log-parameter;"""
OF_STATIC = 0.15
"""of that of static friction, which is known better."""
SHOWN_BY = 0.1
"""By how much a parameter is moved to see what it shows in;"""
MADE_UP_BY = (0.25, 0.5, 1.0, 1.5)
"""and one that makes up for static friction, either way."""


def by_break_aways(error: SimulationError, z: Vector) -> Vector:
    """Return z as `broken_loose` moves it, by all rests; itself where nothing but static friction shows there alone."""
    theta = error.theta(z)
    found = theta if error.run.by.slow else broken_loose(error, Landings(error, rests(error.run.record)), theta)
    return z if found is theta else error.coordinates(found)


def broken_loose(error: SimulationError, landings: Landings, theta: Vector) -> Vector:
    """Return theta, what shows in break-aways alone moved to where these contradict it least.

    It is theta itself where that is static friction alone. What is drawn theta itself decides.
    """
    if not any("friction" in each.functions for each in error.composition.effects):
        return theta
    away = _BreakAways(error, landings, theta)
    z = error.coordinates(theta)
    alone = [
        i for i, each in enumerate(error.parameters) if each.index not in NOT_IN_LANDINGS and away.show_alone(z, i)
    ]
    if not alone:
        return theta
    reach = np.zeros(z.size)
    reach[alone] = 1.0
    reach[[i for i, each in enumerate(error.parameters) if each.index == STATIC]] = OF_STATIC
    generator, least = np.random.default_rng(z.view(np.uint32)), away.contradict(z)
    for _ in range(TRIED):
        way = 10.0 ** generator.uniform(NEAREST, FARTHEST) * reach * generator.standard_normal(z.size)
        there = np.clip(z + way, error.lower, error.upper)
        if (contradicted := away.contradict(there)) < least:
            z, least = there, contradicted
    return error.theta(z)


def making_up(error: SimulationError, z: Vector, anew: Sequence[Vector] = ()) -> list[Vector]:
    """Return z with what makes up for static friction stronger and weaker; none where break-aways tell it from that.

    Args:
        error: of what the break-aways are.
        z: about which; static friction makes up for what is moved.
        anew: places that differ from z in an effect's own parameters, moved so, too.
    """
    if error.run.by.slow or not any(each.index == STATIC for each in error.parameters):
        return []
    landings = Landings(error, rests(error.run.record))
    broken = landings.breaking(error.run.run(error.theta(z)).pressure_pa)
    if not broken.rows.size:
        return []

    here_n = landings.static_at_n(error.theta(z), broken)

    def made_up(there: Vector) -> Vector | None:
        theta = error.theta(there)
        more_n = landings.static_at_n(theta, broken) - here_n
        by_n = float(np.median(more_n))
        theta[STATIC] += by_n
        alike = float(np.ptp(more_n)) <= CONTRADICTED_N < abs(by_n)
        return error.coordinates(theta) if alike and theta[STATIC] >= theta[COULOMB] else None

    own = [i for i, each in enumerate(error.parameters) if each.index >= len(BASE)]
    moved = [_moved(error, z, i, far * way) for i in own for far in MADE_UP_BY for way in (1.0, -1.0)]
    return [each for there in (*moved, *anew) if (each := made_up(there)) is not None]


def _moved(error: SimulationError, z: Vector, i: int, far: float) -> Vector:
    there = z.copy()
    there[i] = np.clip(z[i] + far, error.lower[i], error.upper[i])
    return there


class _BreakAways:
    """The rests of a record, under the loads that they bore and did not bear."""

    def __init__(self, error: SimulationError, landings: Landings, theta: Vector) -> None:
        pressure_pa = error.run.run(theta).pressure_pa
        self._error, self._landings = error, landings
        self._holding, self._breaking = landings.holding(pressure_pa), landings.breaking(pressure_pa)
        self._landed, _ = landings.landed(theta, pressure_pa)

    def contradict(self, z: Vector) -> float:
        """Return C."""
        return _counted(self._beyond_n(z, self._holding)) + _counted(-self._beyond_n(z, self._breaking))

    def show_alone(self, z: Vector, i: int) -> bool:
        """Return whether a parameter changes where rests break loose, and not where slides land."""
        there = _moved(self._error, z, i, SHOWN_BY if z[i] + SHOWN_BY <= self._error.upper[i] else -SHOWN_BY)
        here_n, there_n = (self._landings.balance_n(self._error.theta(each), self._landed) for each in (z, there))
        changes = not np.array_equal(self._beyond_n(z, self._breaking), self._beyond_n(there, self._breaking))
        return changes and bool(np.array_equal(here_n, there_n))

    def _beyond_n(self, z: Vector, at: Loaded) -> Vector:
        return self._landings.beyond_static_n(self._error.theta(z), at)


def _counted(beyond_n: Vector) -> float:
    off = np.maximum(beyond_n, 0.0)
    return float((off / (off + CONTRADICTED_N)).sum())

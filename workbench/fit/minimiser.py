"""The minimiser of the likelihood: scipy's trust region on the soft-L1 cost, from one place to the end it leads to.

    variables        coordinates z of the parameters, and of each move its onset, in periods from where it shows
    derivatives      forward differences: one simulation a parameter, and one, with all onsets shifted, for all onsets:
                     each acts until the next

`begun` lets the landings lead first, with the data sheet as a weak prior: where slides end hangs on forces alone, so
that a start far off finds its valley there.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from sim.composition import COULOMB, SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.fit.breaking_off import go_on
from workbench.fit.likelihood import Groups, Likelihood
from workbench.fit.onsets import by_onsets


@dataclass(frozen=True, slots=True, kw_only=True)
class Search:
    """How far and how finely is searched."""

    reach: float = 3.0
    """Periods about where an onset shows, in which it lies: the first samples in motion are within the noise."""
    step: float = 1e-4
    """Of a coordinate, for its derivatives: a simulation is smooth to a hundredth of that."""
    begin: float = 3.0
    """Weight of landings at the beginning, in their deviations: wide, lest one of them decides the valley."""
    begin_steps: int = 25
    """Evaluations of the derivatives at the beginning."""
    begin_enough: float = 1e-3
    """Relative fall of the cost in a step that ends the beginning."""
    steps: int = 40
    """The same, of all: an end that takes more is not to be had."""
    enough: float = 1e-4
    """Relative fall of the cost in a step that ends the search: a tenth of a nat of a thousand residuals."""
    coarse_steps: int = 8
    """Evaluations of the derivatives of a search that only tells whether it is worth going on."""
    coarse: float = 1e-2
    """Relative fall of the cost in a step that ends it."""


Rows = Callable[[Vector], Vector]
SEARCH = Search()
PRIOR = {SPRING: 0.15, COULOMB: 0.4, VISCOUS: 0.7, STATIC: 0.1}
"""Standard deviations of logarithms by which a valve may be off its data sheet; of F_s / F_c."""


@dataclass(frozen=True, slots=True)
class End:
    """Where a search stays."""

    z: Vector
    onsets_s: Vector
    cost: float
    groups: Groups
    jacobian: Vector
    """Of the residuals by z and onsets, (rows, parameters + moves); empty where it was not asked for."""


def begun(like: Likelihood, z: Vector) -> Vector:
    """Return the coordinates to which landings and break-aways lead, (parameters,)."""
    onsets_s = like.run.first_onsets_s()
    prior = np.array([PRIOR.get(each.index, np.inf) for each in like.parameters])
    lower, upper = _bounds(like)
    start = np.clip(z, lower, upper)

    def rows(z: Vector) -> Vector:
        go_on()
        found = like.at(like.theta(z), onsets_s)
        landed = found.landings * like.landing_m / (SEARCH.begin * like.sigma_m)
        return np.concatenate([landed, found.break_aways, (z - start) / prior])

    def by_z(z: Vector) -> Vector:
        return _differences(rows, z, upper)

    found = least_squares(
        rows, start, by_z, bounds=(lower, upper), loss="soft_l1", f_scale=like.weights.soft, x_scale="jac",
        max_nfev=SEARCH.begin_steps, ftol=SEARCH.begin_enough, xtol=1e-6,
    )  # fmt: skip
    return np.asarray(found.x)


def ended(
    like: Likelihood,
    z: Vector,
    onsets_s: Vector | None = None,
    *,
    coarsely: bool = False,
    held: tuple[Vector, Vector] | None = None,
) -> End:
    """Return where a search from these coordinates, (parameters,), and onsets, s, (moves,), stays.

    Coarsely: where it is after some steps, by which its valley is known. Held: to coordinates, by a matrix that times
    what they are off these is normal.
    """
    first_s, period_s, count = like.run.first_onsets_s(), like.record.period_s, len(like.parameters)
    earliest_s, latest_s = like.run.bounds_s(SEARCH.reach)
    lower, upper = _bounds(like)
    low = np.concatenate([lower, (earliest_s - first_s) / period_s])
    high = np.concatenate([upper, (latest_s - first_s) / period_s])
    begin_s = first_s if onsets_s is None else onsets_s
    start = np.clip(np.concatenate([z, (begin_s - first_s) / period_s]), low, high)
    start = low + np.clip(start - low, 1e-6 * (high - low), (1.0 - 1e-6) * (high - low))

    def parted(v: Vector) -> tuple[Vector, Vector]:
        return v[:count], first_s + period_s * v[count:]

    def rows(v: Vector) -> Vector:
        go_on()
        z, onsets_s = parted(v)
        whole = like.at(like.theta(z), onsets_s).whole
        return whole if held is None else np.concatenate([whole, held[1] @ (z - held[0])])

    def slopes(v: Vector) -> Vector:
        found = derivatives(like, *parted(v))
        if held is None:
            return found
        return np.vstack([found, np.hstack([held[1], np.zeros((count, v.size - count))])])

    found = least_squares(
        rows, start, slopes, bounds=(low, high), loss="soft_l1", f_scale=like.weights.soft, x_scale="jac",
        max_nfev=SEARCH.coarse_steps if coarsely else SEARCH.steps,
        ftol=SEARCH.coarse if coarsely else SEARCH.enough, xtol=1e-9, gtol=1e-9,
    )  # fmt: skip
    z, onsets_s = parted(np.asarray(found.x))
    groups = like.at(like.theta(z), onsets_s)
    jacobian = np.empty((0, 0)) if coarsely else derivatives(like, z, onsets_s)
    return End(z, onsets_s, like.cost(groups.whole), groups, jacobian)


def derivatives(like: Likelihood, z: Vector, onsets_s: Vector) -> Vector:
    """Return the derivatives of the residuals by coordinates and onsets, in periods, (rows, parameters + moves)."""
    _, upper = _bounds(like)
    by_z = _differences(lambda there: like.at(like.theta(there), onsets_s).whole, z, upper)
    return np.hstack([by_z, by_onsets(like, like.theta(z), onsets_s)])


def _bounds(like: Likelihood) -> tuple[Vector, Vector]:
    ends = np.array([each.bounds for each in like.parameters]).reshape(-1, 2)
    return ends[:, 0], ends[:, 1]


def _differences(rows: Rows, z: Vector, upper: Vector) -> Vector:
    """Return the derivatives of rows by coordinates, by forward differences, backward at the upper end."""
    here = rows(z)
    columns = []
    for i in range(z.size):
        step = SEARCH.step if z[i] + SEARCH.step <= upper[i] else -SEARCH.step
        there = z.copy()
        there[i] += step
        columns.append((rows(there) - here) / step)
    return np.array(columns).T.reshape(here.size, z.size)

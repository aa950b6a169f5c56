"""Static friction of a valve whose break-aways scatter: their mean, which no run of the model shows.

    F_s,k ~ N(mu, S)         break-away k's own static friction, N
    lower_k <= F_s,k <= upper_k          what the rest last bore, and what broke it loose
    held_i  <= F_s,i                     what it bore the other way, or never left under

    l = sum_k log (Phi((upper_k - mu)/S) - Phi((lower_k - mu)/S)) + sum_i log (1 - Phi((held_i - mu)/S))
      - (log(S / (F_s/20)))^2 / 8        F_s of the fit: S is held to it loosely

is greatest at the mean; its standard deviation follows from the curvature there. All are taken back to the bare valve's
static friction through the effects, at the rest's place, pressure and time. A free run cannot say it: one break-away
that it has not in time costs more than many a little early, so that its best static friction lies below the mean.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import log_ndtr, ndtr

from sim.composition import COULOMB, STATIC
from sim.karnopp import Vector
from workbench.fit.landings import Landings, rests
from workbench.fit.objective import SimulationError

FEWEST = 8
"""Break-aways."""
GUESSED, LOOSELY = 0.05, 2.0
"""Of static friction: scatter to begin with, and by which power of e it is held to that."""
PADDING = 0.05
"""Of the scatter, by which the interval of a break-away is wider either way: noise may have broken it."""
DIFFERENCE = 0.02
"""Of the scatter, over which the curvature is taken."""
WITHIN_95 = 1.96
TINY = np.finfo(float).tiny


class _Borne(NamedTuple):
    """Bounds of each break-away's static friction, N, (break-aways,), and what was borne besides, N, (loads,)."""

    lower_n: Vector
    upper_n: Vector
    held_n: Vector


def static_within(error: SimulationError, z: Vector) -> list[Vector]:
    """Return z with static friction at either end of the 95 % interval of the mean of break-aways; none if too few.

    Args:
        error: of the record.
        z: coordinates of the fit, by whose pressure and effects loads are told.
    """
    if not any(each.index == STATIC for each in error.parameters):
        return []
    theta = error.theta(z)
    borne = _borne(error, theta)
    if borne.lower_n.size < FEWEST:
        return []
    mean_n, std_n = _mean(borne, GUESSED * float(theta[STATIC]))
    if not np.isfinite(std_n):
        return []
    ends = []
    for way in (-WITHIN_95, WITHIN_95):
        there = theta.copy()
        there[STATIC] = mean_n + way * std_n
        ends.append(error.coordinates(there))
    return ends


def _borne(error: SimulationError, theta: Vector) -> _Borne:
    landings, pressure_pa = Landings(error, rests(error.run.record)), error.run.run(theta).pressure_pa
    bore = landings.holding(pressure_pa)
    leaves = bore.directions == bore.leaves_to
    broke_n, own_n, besides_n = (
        landings.static_at_n(theta, each)
        for each in (landings.breaking(pressure_pa), bore.those(leaves), bore.those(~leaves))
    )
    # A slow stem is at rest, by its samples, for longer than it is; what broke it loose it seems to have borne.
    return _Borne(np.minimum(own_n, broke_n), np.maximum(own_n, broke_n), besides_n[besides_n > theta[COULOMB]])


def _mean(borne: _Borne, guessed_n: float) -> tuple[float, float]:
    """Return mu and its standard deviation, N; that is infinite where the break-aways do not tell.

    Args:
        borne: what they bore.
        guessed_n: their scatter, about.
    """
    middle_n, guessed = float(np.median(0.5 * (borne.lower_n + borne.upper_n))), float(np.log(guessed_n))

    def loss(at: Vector) -> float:
        mean_n, scatter_n = at[0], np.exp(at[1])
        lower, upper = (borne.lower_n - mean_n) / scatter_n - PADDING, (borne.upper_n - mean_n) / scatter_n + PADDING
        between, held = log_between(lower, upper, ndtr), log_ndtr((mean_n - borne.held_n) / scatter_n)
        return float(0.5 * ((at[1] - guessed) / LOOSELY) ** 2 - between.sum() - held.sum())

    best = minimize(loss, [middle_n, guessed], method="Nelder-Mead").x
    curvature = _curvature(loss, best, np.array([DIFFERENCE * np.exp(best[1]), DIFFERENCE]))
    told = bool(np.linalg.eigvalsh(curvature)[0] > 0.0)
    return float(best[0]), float(np.sqrt(np.linalg.inv(curvature)[0, 0])) if told else np.inf


def log_between(lower: Vector, upper: Vector, below: Callable[[Vector], Vector]) -> Vector:
    """Return log (P(upper) - P(lower)), P the share `below`, taken in the lower tail, where it is exact."""
    flipped = lower > 0.0
    low, high = np.where(flipped, -upper, lower), np.where(flipped, -lower, upper)
    return np.asarray(np.log(np.maximum(below(high) - below(low), TINY)))


def _curvature(loss: Callable[[Vector], float], at: Vector, step: Vector) -> NDArray[np.float64]:
    """Return the second derivatives of a loss by central differences, (2, 2)."""
    x, y = np.diag(step)
    here = loss(at)
    both = (loss(at + x + y) - loss(at + x - y) - loss(at - x + y) + loss(at - x - y)) / (4.0 * step[0] * step[1])
    own = [(loss(at + each) - 2.0 * here + loss(at - each)) / size**2 for each, size in ((x, step[0]), (y, step[1]))]
    return np.array([[own[0], both], [both, own[1]]])

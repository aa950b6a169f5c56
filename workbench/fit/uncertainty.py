"""How well a recording determines what was fitted, by the curvature of its likelihood.

    H = J' W^3 J + 1 / f^2   J the residuals by coordinates z and onsets, W = 1 / sqrt(1 + (r / s)^2): the
                             soft L1 has the slope W r and the curvature W^3; f = `FARTHEST`, the deviation of what
                             no residual hangs on
    M = sum_k g_k g_k'       g_k = J_k' W_k r_k of the k-th move and the rest that it ends in: these hang together
    C = H^-1 (H + (n / (n - p)) M) H^-1 / 2,  but no less than H^-1, for n moves and p parameters

H^-1 is right where the residuals are the noise; the sandwich H^-1 M H^-1 (Huber, White, by clusters) where landings
scatter by themselves, and every move is but one witness. An interval is z +- t sqrt C, t Student's of n - p degrees of
freedom, and reaches over those of other ends that are nearly as likely (`ends`). Static friction is what break-aways
leave open: its interval reaches over all values whose cost is within 1.92 of the least, by break-aways alone, and over
that of the curvature, where this determines it. A load at an onset is known as well as that onset,

    r_k / sqrt(1 + (dr_k / do_k)^2 / D_k)     D_k the curvature by the k-th onset

A combination of parameters whose standard deviation exceeds 1, a factor of e, is not determined.
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import exp

import numpy as np
from scipy.special import stdtrit

from sim.composition import STATIC
from sim.karnopp import Vector
from workbench.fit.likelihood import Likelihood, soft, soft_weight
from workbench.fit.minimiser import End
from workbench.fit.onsets import SHIFT

PROBABILITY = 0.975
"""Of Student's t below the upper end of an interval of 95 %."""
NORMAL_QUANTILE = 1.96
"""Deviations that a normal quantity exceeds with the other 2.5 %."""
FEWEST_FREE = 2.0
"""Degrees of freedom of Student's t at least."""
RISE_95 = 1.92
NOTHING = 1e-12
"""Of the largest eigenvalue of the scaled information: one that is none."""
FARTHEST = 8.0
"""Deviation of a coordinate, a logarithm mostly, of which a record says nothing."""
UNDETERMINED = 1.0
"""Standard deviation of a logarithm from which on the curvature does not determine it."""
INVOLVED = 0.3
"""Component of a unit vector from which a parameter is named as part of a combination."""
TOLD = 0.1
"""Change of a log-parameter by which a combination is told."""


@dataclass(frozen=True, slots=True)
class Combination:
    """What may change unseen: parameters, and the power with which each goes, 1 for the one that goes farthest.

    Where the first is multiplied by f the others are by f^power, an effect's parameter that may be zero only in
    proportion to its scale.
    """

    names: tuple[str, ...]
    powers: tuple[float, ...]

    def sentence(self, words: Callable[[str], str] = str) -> str:
        """Say so, a parameter's name in these words."""
        if len(self.names) == 1:
            return f"{words(self.names[0])} is not determined by this recording"
        together = ", ".join(
            f"{words(name)} by {exp(TOLD * power):.3f}" for name, power in zip(self.names, self.powers, strict=True)
        )
        return f"only a combination is determined: these may change together unseen: {together}"


@dataclass(frozen=True, slots=True)
class Uncertainty:
    """Standard deviations and 95 % intervals of the coordinates, in their order; the condition and what is open."""

    std: Vector
    lower: Vector
    upper: Vector
    condition: float
    undetermined: tuple[Combination, ...]
    off: Vector
    """Step to where the cost would be least, were no coordinate bounded, in deviations, (parameters,)."""
    root: Vector
    """(parameters, parameters): what times a step of the coordinates is as unlikely as so many deviations."""


@dataclass(frozen=True, slots=True)
class Curvature:
    """What the likelihood is like about an end."""

    information: Vector
    """H, (parameters + moves, parameters + moves)."""
    covariance: Vector
    """H^-1, as `information`."""
    condition: float
    std: Vector
    """Of the coordinates, (parameters,)."""
    off: Vector
    """Newton's step -C J' W r, in deviations, (parameters,): 0 but where a bound holds a coordinate."""
    reach: Vector
    """Half of the interval of 95 %, (parameters,); infinite where no residual hangs on a coordinate."""


def _curvature(like: Likelihood, end: End) -> Curvature:
    count = len(like.parameters)
    r = end.groups.whole
    weight = soft_weight(r, like.weights.soft)
    J = end.jacobian
    lengths = np.linalg.norm(J, axis=0)
    scale = np.hypot(lengths, 1.0 / FARTHEST)
    scaled = J / scale
    H = scaled.T @ (weight[:, None] ** 3 * scaled) + np.diag((FARTHEST * scale) ** -2.0)
    values, vectors = np.linalg.eigh(H)
    values = np.maximum(values, NOTHING * values[-1])
    inverse = (vectors / values) @ vectors.T
    scores = np.zeros((len(like.moves) + 1, scaled.shape[1]))  # the last: what belongs to no move
    np.add.at(scores, like.move_of, (weight * r)[:, None] * scaled)
    scores = scores[:-1]
    free = max(float(len(scores)) - count, FEWEST_FREE)
    sandwich = np.diag(inverse @ (scores.T @ scores * (len(scores) / free)) @ inverse)
    variance = np.maximum(np.diag(inverse), sandwich) / scale**2
    std = np.minimum(np.sqrt(variance), FARTHEST)[:count]
    reach = np.where(sandwich > np.diag(inverse), stdtrit(free, PROBABILITY), NORMAL_QUANTILE)[:count] * std
    reach[lengths[:count] == 0.0] = np.inf
    off = -(inverse @ (scaled.T @ (weight * r)) / scale)[:count] / std
    by = np.outer(scale, scale)
    return Curvature(H * by, inverse / by, float(np.sqrt(values[-1] / values[0])), std, off, reach)


def uncertainty(like: Likelihood, end: End) -> Uncertainty:
    """Judge where a search stays; its Jacobian must be there."""
    count = len(like.parameters)
    about = _curvature(like, end)
    std, lower, upper = about.std, end.z - about.reach, end.z + about.reach
    for other in end.as_likely:
        reach = _curvature(like, other).reach * np.sqrt(1.0 - (other.cost - end.cost) / RISE_95)
        lower, upper = np.minimum(lower, other.z - reach), np.maximum(upper, other.z + reach)
    std = np.maximum(std, np.minimum((upper - lower) / (2.0 * NORMAL_QUANTILE), FARTHEST))
    for i, each in enumerate(like.parameters):
        if each.index == STATIC:
            low, high = _static_interval(like, end, i, np.diag(about.information)[count:])
            determined = std[i] < UNDETERMINED
            lower[i], upper[i] = (min(lower[i], low), max(upper[i], high)) if determined else (low, high)
            std[i] = max(std[i] if determined else 0.0, 0.25 * (high - low))
    open_ones = _open_combinations(like, about.information[:count, :count])
    root = _root(about.covariance[:count, :count], std)
    return Uncertainty(std, lower, upper, about.condition, open_ones, about.off, root)


def _root(covariance: Vector, std: Vector) -> Vector:
    """Return R, R'R the information on coordinates that hang together as in a covariance, with these deviations."""
    own = np.sqrt(np.diag(covariance))
    hangs = covariance / np.outer(np.where(own > 0.0, own, 1.0), np.where(own > 0.0, own, 1.0))
    np.fill_diagonal(hangs, 1.0)
    values, vectors = np.linalg.eigh(hangs)
    return np.asarray((vectors / np.sqrt(np.maximum(values, NOTHING))).T / np.maximum(std, NOTHING))


def _static_interval(like: Likelihood, end: End, i: int, by_onset: Vector) -> tuple[float, float]:
    """Return between which coordinates of static friction break-aways cost no more than 1.92 above the least.

    Args:
        like: the likelihood.
        end: where a search stays.
        i: index of static friction among the coordinates.
        by_onset: curvature by each onset, in periods, (moves,).
    """
    theta, parameter = like.theta(end.z), like.parameters[i]
    path, later = (like.run.run(theta, end.onsets_s + shift * like.run.period_s) for shift in (0.0, SHIFT))
    gains = np.nan_to_num((later.breaks_n - path.breaks_n) / SHIFT / like.load_n)
    wider = np.hypot(1.0, gains / np.sqrt(np.maximum(by_onset, FARTHEST**-2.0)))[like.broken]
    reach = np.concatenate([-np.geomspace(1.0, 1e-4, 200), [0.0], np.geomspace(1e-4, 1.0, 200)])
    at = np.unique(np.clip(end.z[i] + reach, *parameter.bounds))
    static_n = []
    for z in at:
        parameter.put(theta, float(z))
        static_n.append(theta[STATIC])
    costs = soft(like.rows_of_static(path, np.array(static_n), wider), like.weights.soft).sum(axis=1)
    scatter = max(1.0, 2.0 * min(costs) / max(like.broken.size - 1, 1))
    near = np.flatnonzero(costs <= min(costs) + RISE_95 * scatter)
    return float(at[max(near[0] - 1, 0)]), float(at[min(near[-1] + 1, at.size - 1)])  # where it is dearer already


def _open_combinations(like: Likelihood, H: Vector) -> tuple[Combination, ...]:
    """Return what the curvature leaves open, the onsets held: static friction apart, which break-aways bound."""
    rows = [i for i, each in enumerate(like.parameters) if each.index != STATIC]
    values, vectors = np.linalg.eigh(H[np.ix_(rows, rows)])
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value > UNDETERMINED**-2:
            continue
        order = np.argsort(-np.abs(vector))
        involved = [i for i in order if abs(vector[i]) > INVOLVED]
        names = tuple(like.parameters[rows[i]].name for i in involved)
        found.append(Combination(names, tuple(float(vector[i] / vector[involved[0]]) for i in involved)))
    return tuple(found)

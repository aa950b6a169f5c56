"""How well a recording determines what was fitted, by the curvature of its likelihood.

    H = J' W^3 J + 1 / f^2   J the residuals by coordinates z and onsets, W = 1 / sqrt(1 + (r / s)^2): the
                             soft L1 has the slope W r and the curvature W^3; f = `farthest_deviation`, of what no
                             residual hangs on
    C = H^-1, but no less in any coordinate than (n - 1) / n sum_k d_k^2, and of an interval (n - 1) / n sum_k e_k^2 / b
    d_k = (A - A_k)^-1 g_k   by how much the coordinates move without the k-th of n moves and the rest that it ends in;
                             A = sum_k A_k curvature by coordinates, onsets eliminated, g_k = J_k' W_k r_k
    e_k = d_k + ... + d_(k + b - 1)     the same of b = `moves_together` moves in a row

H^-1 is right where the residuals are the noise; the jackknife by moves (Tukey) where landings scatter by themselves,
and every move is but one witness; that by blocks (Kuensch 1989) where moves in a row share what disturbs them. An
interval is z +- t sqrt C, t Student's with the degrees of freedom of those moves that tell of a coordinate
(Satterthwaite; Bell and McCaffrey), v_k what the k-th brings to its variance:

    nu = (sum v_k)^2 / sum v_k^2,   v_k = diag (A - A_k)^-1 A_k (A - A_k)^-1

It reaches over the intervals of other ends that are nearly as likely (`ends`).

Static friction is what break-aways leave open. Their interval reaches over all values whose cost, by break-aways alone,
is within 1.92 of the least; farther by what it changes, in squares, 1.96 deviations along each principal direction of
the other coordinates; and over z +- 1.96 sqrt C where the curvature determines it. A load at an onset is known as well
as that onset,

    r_k / sqrt(1 + (dr_k / do_k)^2 / D_k)     D_k the curvature by the k-th onset

Where break-aways scatter, s^2 = 2 cost / (n - 1) > 1, a force that no record holds breaks the stem loose, which it does
early alone: the upper end goes up by `earliest_deviations` of its deviations, sqrt(s^2 - 1) L_0.

A combination of parameters whose standard deviation exceeds 1, a factor of e, is not determined.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp

import numpy as np
from scipy.linalg import eigh
from scipy.special import stdtrit

from sim.composition import COULOMB, STATIC
from sim.karnopp import Vector
from workbench.fit.fit_thresholds import FIT
from workbench.fit.likelihood import Likelihood, coupling, soft, soft_weight
from workbench.fit.minimiser import End
from workbench.model.told_run import ToldPath

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
    shared: Vector
    """Factor on that where moves in a row share what disturbs them, (parameters,)."""


def _curvature(like: Likelihood, end: End) -> Curvature:
    count = len(like.parameters)
    r = end.groups.whole
    weight = soft_weight(r)
    J = end.jacobian
    lengths = np.linalg.norm(J, axis=0)
    scale = np.hypot(lengths, 1.0 / FIT.intervals.farthest_deviation)
    scaled = J / scale
    prior = (FIT.intervals.farthest_deviation * scale) ** -2.0
    H = scaled.T @ (weight[:, None] ** 3 * scaled) + np.diag(prior)
    values, vectors = principal_axes(H)
    values = np.maximum(values, FIT.nothing * values[-1])
    inverse = (vectors / values) @ vectors.T
    without, free = _without_each_move(like, scaled, weight, r, count, prior[:count])
    own, apart, together = (
        np.diag(inverse)[:count],
        _variance(without, 1),
        _variance(without, FIT.intervals.moves_together),
    )
    alone = np.maximum(own, apart)
    std = np.minimum(np.sqrt(alone) / scale[:count], FIT.intervals.farthest_deviation)
    of_student = stdtrit(np.maximum(free, FIT.intervals.fewest_free), FIT.intervals.upper_probability)
    reach = np.where(apart > own, of_student, FIT.intervals.deviations) * std
    shared = np.sqrt(np.maximum(together, alone) / alone)
    reach[lengths[:count] == 0.0] = np.inf
    off = -(inverse @ (scaled.T @ (weight * r)) / scale)[:count] / std
    by = np.outer(scale, scale)
    condition = float(np.sqrt(values[-1] / values[0]))
    return Curvature(H * by, inverse / by, condition, std, off, reach, shared)


def principal_axes(matrix: Vector) -> tuple[Vector, Vector]:
    """Return the eigenvalues of a symmetric matrix, ascending, and its eigenvectors, in columns.

    By QR steps: divide and conquer, numpy's way, did not converge on a well conditioned information of 36 rows.
    """
    values, vectors = eigh(matrix, driver="ev")
    return np.asarray(values), np.asarray(vectors)


def _variance(d: Vector, together: int) -> Vector:
    """Return what the jackknife by so many moves in a row, each of n without one by d, (n, columns), comes to."""
    sums = np.cumsum(np.vstack([np.zeros((1, d.shape[1])), d]), axis=0)
    e, moves = sums[together:] - sums[:-together], len(d)
    return np.asarray((moves - 1.0) / moves * np.sum(e**2, axis=0) / together)


def _without_each_move(
    like: Likelihood, J: Vector, weight: Vector, r: Vector, count: int, prior: Vector
) -> tuple[Vector, Vector]:
    """Return d_k, by how much the coordinates move without the k-th move, (moves, parameters), and nu, (parameters,).

    Args:
        like: the likelihood.
        J: derivatives of the residuals, scaled, (rows, parameters + moves).
        weight: W, (rows,).
        r: residuals, (rows,).
        count: parameters.
        prior: information on each before anything is recorded, (parameters,).
    """
    moves = len(like.moves)
    by_z, by_onset = J[:, :count], J[:, count:].sum(axis=1)

    def sums(rows: Vector) -> Vector:
        """Return sums over the rows of each move, the last over those of none, (moves + 1, columns)."""
        found = np.zeros((moves + 1, rows.shape[1]))
        np.add.at(found, like.move_of, rows)
        return found

    curved = weight[:, None] ** 3 * by_z
    A = sums((curved[:, :, None] * by_z[:, None, :]).reshape(len(J), count**2)).reshape(moves + 1, count, count)
    C, D = coupling(like.move_of, by_z, by_onset, weight**3, moves)
    A[:-1] -= C.T[:, :, None] * C.T[:, None, :] / np.maximum(D, FIT.nothing)[:, None, None]
    g = sums((weight * r)[:, None] * by_z)[:-1]
    without = np.linalg.inv(A.sum(axis=0) + np.diag(prior) - A[:-1])
    share = np.diagonal(without @ A[:-1] @ without, axis1=1, axis2=2)
    free = share.sum(axis=0) ** 2 / np.maximum((share**2).sum(axis=0), np.finfo(float).tiny)
    return (without @ g[:, :, None])[:, :, 0], free


@dataclass(frozen=True, slots=True, kw_only=True)
class Interval:
    """Between which coordinates 95 % lie, each (parameters,); what disturbs a record takes the truth farther."""

    lower: Vector
    upper: Vector
    shared: Vector
    """As of `Curvature`; 1 of static friction."""
    early: Vector
    """Deviation of what breaks the stem loose early, in `upper` once; 0 of all but static friction."""

    def of_truth(self, z: Vector) -> tuple[Vector, Vector]:
        """Return the ends within which the truth lies, about coordinates, (parameters,)."""
        beyond = (FIT.intervals.earliest_deviations - 1.0) * self.early
        return z - self.shared * (z - self.lower), z + self.shared * (self.upper - z) + beyond


def uncertainty(like: Likelihood, end: End) -> Uncertainty:
    """Judge where a search stays; its Jacobian must be there.

    Where to search, and what held-out moves may ask, it is within the deviations alone.
    """
    count = len(like.parameters)
    about, own = _about(like, end)
    lower, upper = own.lower, own.upper
    for other in end.as_likely:
        _, there = _about(like, other)
        share = np.sqrt(1.0 - (other.cost - end.cost) / FIT.intervals.rise_nats)
        lower = np.minimum(lower, other.z - share * (other.z - there.lower))
        upper = np.maximum(upper, other.z + share * (there.upper - other.z))
    widest = (upper - lower) / (2.0 * FIT.intervals.deviations)
    std = np.maximum(about.std, np.minimum(widest, FIT.intervals.farthest_deviation))
    open_ones = _open_combinations(like, about.information[:count, :count])
    root = _root(about.covariance[:count, :count], std)
    farther = replace(own, lower=lower, upper=upper).of_truth(end.z)
    return Uncertainty(std, *farther, about.condition, open_ones, about.off, root)


def _about(like: Likelihood, end: End) -> tuple[Curvature, Interval]:
    """Return what the likelihood is like about an end, and between which coordinates 95 % lie there."""
    about = _curvature(like, end)
    std, lower, upper = about.std.copy(), end.z - about.reach, end.z + about.reach
    shared, early = about.shared.copy(), np.zeros(end.z.size)
    for i, each in enumerate(like.parameters):
        if each.index == STATIC:
            low, high, early[i] = _static_interval(like, end, i, about)
            high = min(high + early[i], each.bounds[1])
            std[i] = max(std[i] if std[i] < FIT.intervals.undetermined_deviation else 0.0, 0.25 * (high - low))
            by_curvature = FIT.intervals.deviations * std[i]
            lower[i], upper[i], shared[i] = min(low, end.z[i] - by_curvature), max(high, end.z[i] + by_curvature), 1.0
    return replace(about, std=std), Interval(lower=lower, upper=upper, shared=shared, early=early)


def _root(covariance: Vector, std: Vector) -> Vector:
    """Return R, R'R the information on coordinates that hang together as in a covariance, with these deviations."""
    own = np.sqrt(np.diag(covariance))
    hangs = covariance / np.outer(np.where(own > 0.0, own, 1.0), np.where(own > 0.0, own, 1.0))
    np.fill_diagonal(hangs, 1.0)
    values, vectors = principal_axes(hangs)
    return np.asarray((vectors / np.sqrt(np.maximum(values, FIT.nothing))).T / np.maximum(std, FIT.nothing))


def _static_interval(like: Likelihood, end: End, i: int, about: Curvature) -> tuple[float, float, float]:
    """Return the interval of the i-th coordinate, static friction, by break-aways and what others change of it.

    And the deviation of what breaks the stem loose early.
    """
    theta = like.theta(end.z)
    path, later = (
        like.run.run(theta, end.onsets_s + shift * like.run.period_s) for shift in (0.0, FIT.onsets.shift_periods)
    )
    gains = np.nan_to_num((later.breaks_n - path.breaks_n) / FIT.onsets.shift_periods / like.load_n)
    by_onset = np.diag(about.information)[end.z.size :]
    wider = np.hypot(1.0, gains / np.sqrt(np.maximum(by_onset, FIT.intervals.farthest_deviation**-2.0)))[like.broken]
    low, high, early = _by_break_aways(like, theta, path, i, wider)
    others = np.delete(np.arange(end.z.size), i)
    values, vectors = principal_axes(about.covariance[np.ix_(others, others)])
    below = above = 0.0
    for way in (FIT.intervals.deviations * np.sqrt(np.maximum(values, 0.0)) * vectors).T:
        found = []
        for step in (-way, way):
            there = like.theta(np.clip(end.z + np.insert(step, i, 0.0), *like.bounds))
            found.append(_by_break_aways(like, there, like.run.run(there, end.onsets_s), i, wider))
        below += max(0.0, *(low - lowest for lowest, _, _ in found)) ** 2
        above += max(0.0, *(highest - high for _, highest, _ in found)) ** 2
    least, most = like.parameters[i].bounds
    return max(low - below**0.5, least), min(high + above**0.5, most), early


def _by_break_aways(
    like: Likelihood, theta: Vector, path: ToldPath, i: int, wider: Vector
) -> tuple[float, float, float]:
    """Return between which values of the i-th coordinate break-aways cost no more than 1.92 above the least.

    And the deviation, as of that coordinate, by which what breaks the stem loose scatters beyond what a record holds.
    """
    bounds, z = like.parameters[i].bounds, like.parameters[i].coordinate(theta)
    reach = np.concatenate([-np.geomspace(1.0, 1e-4, 200), [0.0], np.geomspace(1e-4, 1.0, 200)])
    at = np.unique(np.clip(z + reach, *bounds))
    static_n = theta[COULOMB] * np.exp(at)
    costs = soft(like.rows_of_static(path, static_n, wider)).sum(axis=1)
    scatter = max(1.0, 2.0 * min(costs) / max(like.broken.size - 1, 1))
    near = np.flatnonzero(costs <= min(costs) + FIT.intervals.rise_nats * scatter)
    low, high = float(at[max(near[0] - 1, 0)]), float(at[min(near[-1] + 1, at.size - 1)])  # where it is dearer already
    early = np.sqrt(scatter - 1.0) * like.load_n / static_n[int(np.argmin(costs))]
    return low, high, float(np.log1p(early))


def _open_combinations(like: Likelihood, H: Vector) -> tuple[Combination, ...]:
    """Return what the curvature leaves open, the onsets held: static friction apart, which break-aways bound."""
    rows = [i for i, each in enumerate(like.parameters) if each.index != STATIC]
    values, vectors = principal_axes(H[np.ix_(rows, rows)])
    found = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value > FIT.intervals.undetermined_deviation**-2:
            continue
        order = np.argsort(-np.abs(vector))
        involved = [i for i in order if abs(vector[i]) > FIT.intervals.involved_component]
        names = tuple(like.parameters[rows[i]].name for i in involved)
        found.append(Combination(names, tuple(float(vector[i] / vector[involved[0]]) for i in involved)))
    return tuple(found)

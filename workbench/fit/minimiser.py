"""The minimiser of the likelihood: damped Gauss-Newton steps on the soft-L1 cost, from a place to the end they lead to.

    r(z, o)                    residuals; z coordinates of the parameters, o of each move its onset, in periods from
                               where it shows
    W = 1 / sqrt(1 + (r / s)^2),   H = J' W J,   g = J' W r
    (H + lambda diag H) (dz, do) = -g                            Levenberg and Marquardt, on reweighted squares

A residual hangs on the onset of one move alone. H is [A, C; C', D] with D diagonal, and the onsets are eliminated:

    (A - C D^-1 C') dz = -(g_z - C D^-1 g_o),   do = -D^-1 (g_o + C' dz)

J is taken by forward differences, one simulation a parameter and one for all onsets, and kept up by what each step
shows (Broyden), move by move:  J <- J + (dr - J dv) dv' / |dv|^2, v = (z, o), lengths by the curvature. It is taken
anew where a step falls short of what it promised, and before an end is believed; over a wider step where a search stays
on an edge: a stem that just sticks there, and just does not beside it, has a slope that is one side's.

`begin_by_landings` lets the landings lead first, with the data sheet as a weak prior: where slides end hangs on forces
alone, so that a start far off finds its valley there.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sim.composition import COULOMB, SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.fit.breaking_off import go_on
from workbench.fit.fit_thresholds import FIT, Effort
from workbench.fit.likelihood import Groups, Likelihood, Rows, by_move, cost_of, coupling, soft, soft_weight


class Slopes(NamedTuple):
    """The derivatives of residuals."""

    by_z: Vector
    """(rows, parameters)."""
    by_onset: Vector
    """By the onset, in periods, of the move that each belongs to, (rows,)."""


class Place(NamedTuple):
    """Coordinates, (parameters,), and onsets, in periods from where they show, (moves,)."""

    z: Vector
    o: Vector


@dataclass(frozen=True, slots=True)
class Ground:
    """What is to be lowered, and between which places."""

    rows: Callable[[Place], Vector]
    of: Rows
    """The move that each residual belongs to, (rows,); the number of moves: none."""
    low: Place
    high: Place

    def of_moves(self, values: Vector) -> Vector:
        """Return sums over the residuals of each move, (moves,)."""
        return by_move(self.of, values, self.low.o.size)

    def to_rows(self, values: Vector) -> Vector:
        """Return of each residual its move's value, (rows,); 0 of none."""
        return np.asarray(np.append(values, 0.0)[self.of])

    def slopes(self, at: Place, r: Vector, step: float = FIT.descent.step) -> Slopes:
        """Return the derivatives of residuals r, by forward differences, backward at an upper end."""
        by_z = np.empty((r.size, at.z.size))
        for i in range(at.z.size):
            step = abs(step) if at.z[i] + abs(step) <= self.high.z[i] else -abs(step)
            there = at.z.copy()
            there[i] += step
            by_z[:, i] = (self.rows(Place(there, at.o)) - r) / step
        if not at.o.size:
            return Slopes(by_z, np.zeros(r.size))
        shifted = (self.rows(Place(at.z, at.o + FIT.onsets.shift_periods)) - r) / FIT.onsets.shift_periods
        return Slopes(by_z, np.where(self.of < at.o.size, shifted, 0.0))


def minimise(ground: Ground, begin: Place, effort: Effort) -> Place:
    """Return the place to which damped steps lead with so much effort."""
    left, enough, rows = effort.simulations, effort.enough, ground.rows

    def simulated(place: Place) -> Vector:
        nonlocal left
        left -= 1
        return rows(place)

    here = Place(*(np.clip(at, low, high) for at, low, high in zip(begin, ground.low, ground.high, strict=True)))
    ground = replace(ground, rows=simulated)
    r = ground.rows(here)
    cost, slopes, fresh, damping, idle = cost_of(r), ground.slopes(here, r), True, FIT.damping.first_lambda, False
    while left > 0 and damping <= FIT.damping.most_lambda:
        step, lengths = _step(ground, here, r, slopes, damping)
        linear = r + slopes.by_z @ step.z + slopes.by_onset * ground.to_rows(step.o)
        promised, free = cost - cost_of(linear), damping <= FIT.damping.free_lambda
        if promised <= 0.5 * enough * cost * (1.0 if free else FIT.damping.free_lambda):
            if fresh:
                break
            slopes, fresh = ground.slopes(here, r, _width(damping)), True
            continue
        there = Place(here.z + step.z, here.o + step.o)
        r_there = ground.rows(there)
        gained = cost - cost_of(r_there)
        if gained <= FIT.damping.poor_share * promised and here.o.size:
            there, r_there = _with_onsets_that_help(ground, there, r_there, here.o)
            step = Place(step.z, there.o - here.o)
            linear = r + slopes.by_z @ step.z + slopes.by_onset * ground.to_rows(step.o)
            gained = cost - cost_of(r_there)
        kept, small = gained > FIT.damping.poor_share * promised, gained < enough * cost
        if gained <= 0.0:
            damping *= FIT.damping.failed_factor
            if not fresh or damping / FIT.damping.failed_factor <= FIT.damping.free_lambda < damping:
                slopes, fresh = ground.slopes(here, r, _width(damping)), True
            continue
        slopes = _seen(ground, slopes, r_there - linear, step, lengths)
        here, r, cost = there, r_there, cost - gained
        if fresh and small and (idle or (free and kept)):
            break
        good = gained > FIT.damping.good_share * promised
        factor = FIT.damping.good_factor if good else 1.0 if kept else FIT.damping.poor_factor
        damping = max(factor * damping, FIT.damping.least_lambda)
        idle, fresh = small, small or not kept
        if fresh:
            slopes = ground.slopes(here, r, _width(damping))
    return here


def _width(damping: float) -> float:
    """Return the step of a coordinate for its derivatives: wide where no step over narrow slopes led lower."""
    return FIT.descent.wide_step if damping > FIT.damping.free_lambda else FIT.descent.step


def _with_onsets_that_help(ground: Ground, there: Place, r: Vector, before: Vector) -> tuple[Place, Vector]:
    """Return a place with those of its onsets left as before whose moves do better so, if all together do; residuals.

    Where a command steps an onset has no slope on one side: what it was promised may be the other's.
    """
    left = ground.rows(Place(there.z, before))
    worse = ground.of_moves(soft(left)) < ground.of_moves(soft(r))
    mixed = Place(there.z, np.where(worse, before, there.o))
    r_mixed = ground.rows(mixed)
    return (mixed, r_mixed) if cost_of(r_mixed) < cost_of(r) else (there, r)


def _step(ground: Ground, here: Place, r: Vector, slopes: Slopes, damping: float) -> tuple[Place, Place]:
    """Return the damped step inside the bounds, and the square root of the curvature by each variable."""
    J, j = slopes
    weight = soft_weight(r)
    A, g_z = J.T @ (weight[:, None] * J), J.T @ (weight * r)
    C, D = coupling(ground.of, J, j, weight, here.o.size)
    g_o = ground.of_moves(weight * r * j)
    diagonal = np.diag(A).copy()
    stays = ((here.o <= ground.low.o) & (g_o > 0.0)) | ((here.o >= ground.high.o) & (g_o < 0.0)) | (FIT.nothing >= D)
    usual = D.mean() if D.size else 0.0  # an onset that its move hardly hangs on is not thrown about for it
    damped = np.where(stays, np.inf, D + damping * np.maximum(D, usual) + FIT.nothing)
    S = A + np.diag((damping + FIT.nothing) * diagonal) - (C / damped) @ C.T
    wanted = (C / damped) @ g_o - g_z
    free = ~(((here.z <= ground.low.z) & (g_z > 0.0)) | ((here.z >= ground.high.z) & (g_z < 0.0)) | (diagonal <= 0.0))
    longest = FIT.damping.longest_step / (1.0 + 10.0 * damping)
    low = np.maximum(FIT.damping.share_to_bound * (ground.low.z - here.z), -longest)
    high = np.minimum(FIT.damping.share_to_bound * (ground.high.z - here.z), longest)
    z = np.zeros(here.z.size)
    while free.any():
        z[free] = np.linalg.lstsq(S[np.ix_(free, free)], wanted[free] - S[np.ix_(free, ~free)] @ z[~free])[0]
        out = free & ((z < low) | (z > high))
        z[out] = np.clip(z, low, high)[out]
        if not out.any():
            break
        free &= ~out
    o = np.clip(here.o - (g_o + z @ C) / damped, ground.low.o, ground.high.o) - here.o
    return Place(z, o), Place(np.sqrt(diagonal), np.sqrt(np.maximum(D, FIT.nothing)))


def _seen(ground: Ground, slopes: Slopes, miss: Vector, step: Place, lengths: Place) -> Slopes:
    """Return derivatives by which a step would have missed nothing."""
    z, o = lengths.z * step.z, lengths.o * step.o
    part = miss / np.maximum(z @ z + ground.to_rows(o**2), np.finfo(float).tiny)
    return Slopes(slopes.by_z + part[:, None] * (lengths.z * z), slopes.by_onset + part * ground.to_rows(lengths.o * o))


@dataclass(frozen=True, slots=True)
class End:
    """Where a search stays."""

    z: Vector
    onsets_s: Vector
    cost: float
    groups: Groups
    jacobian: Vector
    """Of the residuals by z and onsets, (rows, parameters + moves); empty where it was not asked for."""
    is_eased: bool = False
    """Whether the likelihood was."""
    as_likely: tuple["End", ...] = ()
    """Other ends within the interval of 95 %."""


def begin_by_landings(like: Likelihood, z: Vector) -> Vector:
    """Return the coordinates to which landings and break-aways lead, (parameters,)."""
    onsets_s = like.run.first_onsets_s()
    sheet = FIT.sheet
    deviations = {
        SPRING: sheet.spring_deviation,
        COULOMB: sheet.coulomb_deviation,
        VISCOUS: sheet.viscous_deviation,
        STATIC: sheet.static_deviation,
    }
    prior = np.array([deviations.get(each.index, np.inf) for each in like.parameters])
    low, high = like.bounds
    start, none = np.clip(z, low, high), np.empty(0)

    def rows(at: Place) -> Vector:
        go_on()
        found = like.at(like.theta(at.z), onsets_s)
        return np.concatenate([like.wide_landings(found), (at.z - start) / prior])

    of = np.zeros(like.layout.per_rest.size + like.broken.size + start.size, dtype=np.int64)
    ground = Ground(rows, of, Place(low, none), Place(high, none))
    return minimise(ground, Place(start, none), FIT.descent.by_landings).z


def descend(
    like: Likelihood,
    z: Vector,
    onsets_s: Vector | None = None,
    effort: Effort = FIT.descent.whole,
    *,
    held: tuple[Vector, Vector] | None = None,
) -> End:
    """Return where a search from these coordinates, (parameters,), and onsets, s, (moves,), stays, or is so far.

    Held: to coordinates, by a matrix that times what they are off these is normal.
    """
    ground = _ground(like, held)
    begin_s = like.run.first_onsets_s() if onsets_s is None else onsets_s
    found = minimise(ground, Place(z, _periods(like, begin_s)), effort)
    onsets_s = _seconds(like, found.o)
    groups = like.at(like.theta(found.z), onsets_s)
    jacobian = derivatives(like, found.z, onsets_s) if effort == FIT.descent.whole else np.empty((0, 0))
    return End(found.z, onsets_s, cost_of(groups.whole), groups, jacobian, like.is_eased)


def derivatives(like: Likelihood, z: Vector, onsets_s: Vector) -> Vector:
    """Return the derivatives of the residuals by coordinates and onsets, in periods, (rows, parameters + moves)."""
    ground, at = _ground(like), Place(z, _periods(like, onsets_s))
    by_z, by_onset = ground.slopes(at, ground.rows(at))
    of_move = np.zeros((by_onset.size, onsets_s.size + 1))
    of_move[np.arange(by_onset.size), like.move_of] = by_onset
    return np.hstack([by_z, of_move[:, :-1]])


def _ground(like: Likelihood, held: tuple[Vector, Vector] | None = None) -> Ground:
    """Return the ground of a likelihood, its coordinates held as of `descend`."""
    low, high = like.bounds
    earliest_s, latest_s = like.run.bounds_s(FIT.onsets.reach_periods)

    def rows(at: Place) -> Vector:
        go_on()
        whole = like.at(like.theta(at.z), _seconds(like, at.o)).whole
        return whole if held is None else np.concatenate([whole, held[1] @ (at.z - held[0])])

    of = like.move_of if held is None else np.append(like.move_of, np.full(low.size, len(like.moves)))
    return Ground(rows, of, Place(low, _periods(like, earliest_s)), Place(high, _periods(like, latest_s)))


def _periods(like: Likelihood, onsets_s: Vector) -> Vector:
    return np.asarray((onsets_s - like.run.first_onsets_s()) / like.run.period_s)


def _seconds(like: Likelihood, o: Vector) -> Vector:
    return np.asarray(like.run.first_onsets_s() + like.run.period_s * o)

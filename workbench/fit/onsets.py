"""The onsets of a record's moves that suit a valve best.

An onset acts until the next one only: all are found at once, each by its own parabola, from the best of some tries. One
more simulation, with all onsets shifted, gives all their derivatives.
"""

from dataclasses import dataclass

import numpy as np

from sim.karnopp import Vector
from workbench.fit.breaking_off import go_on
from workbench.fit.likelihood import Groups, Likelihood, by_move, soft, soft_weight


@dataclass(frozen=True, slots=True, kw_only=True)
class OnsetSearch:
    """How onsets are sought."""

    reach: float = 3.0
    """Periods about where an onset shows, in which it lies: the first samples in motion are within the noise."""
    tried: tuple[float, ...] = (2.0, 1.0, 0.5, 0.0, -0.5, -1.0, -2.0)
    """Periods from where an onset shows, at which it is sought first, the last first."""
    tries: int = 3
    """Rounds of these, of the onsets that did not keep in all together what they promised."""
    as_good: float = 0.5
    """Nats within which the later of two is taken: a stem let go before it is pushed shows not what breaks it loose."""
    rounds: int = 6
    """Of parabolas: the bottom takes two, a step that is taken back two more."""
    first_step: float = 0.5
    """Periods that an onset moves at most in a round."""
    unseen_step: float = 10.0
    """The same where the stem may move before it is seen to: it has left by as much as its play takes."""
    left: float = 0.5
    """Nats that a round gains at least, of all onsets together: the ends of searches are one within a nat."""
    shorter: float = 0.3
    """Factor on that where a step led higher."""


SEARCH = OnsetSearch()
SHIFT = 0.1
"""Periods by which onsets are shifted for their derivatives."""


def with_onsets(like: Likelihood, theta: Vector, rounds: int | None = None) -> tuple[Vector, Groups]:
    """Return the onsets, s, (moves,), that suit a valve best, (parameters,), and the residuals with them.

    Each onset acts until the next: all are found at once, each by its own parabola, and kept where they help.
    """
    earliest_s, latest_s = like.run.bounds_s(SEARCH.reach)
    period_s, onsets_s = like.run.period_s, like.run.first_onsets_s()
    open_ = np.ones(onsets_s.size, dtype=np.bool_)
    for _ in range(SEARCH.tries):
        tried = [
            np.where(open_, np.clip(like.run.first_onsets_s() + by * period_s, earliest_s, latest_s), onsets_s)
            for by in SEARCH.tried
        ]
        costs = np.array([_cost_by_move(like, like.at(theta, each)) for each in tried])
        best = np.argmax(costs <= np.min(costs, axis=0) + SEARCH.as_good, axis=0)
        onsets_s = np.choose(best, tried) if best.size else onsets_s
        promised = np.min(costs, axis=0) + 2.0 * SEARCH.as_good
        # A stem that a late onset before kept sliding does not wait for its own: what is not kept is tried by itself.
        open_ = _cost_by_move(like, like.at(theta, onsets_s)) > promised
        if not open_.any():
            break
    groups = like.at(theta, onsets_s)
    reach = np.full(onsets_s.size, SEARCH.unseen_step if like.run.hidden else SEARCH.first_step)
    for number in range((rounds or SEARCH.rounds) if onsets_s.size else 0):
        go_on()
        slopes = by_onsets(like, theta, onsets_s)
        r = groups.whole
        weight = soft_weight(r, like.weights.soft)
        downhill = by_move(like.move_of, slopes * weight * r, onsets_s.size)
        bend = by_move(like.move_of, slopes**2 * weight, onsets_s.size)
        way = -downhill / np.maximum(bend, 1e-12)
        there_s = np.clip(onsets_s + period_s * np.clip(way, -reach, reach), earliest_s, latest_s)
        moved = like.at(theta, there_s)
        better = _cost_by_move(like, moved) < _cost_by_move(like, groups)
        onsets_s = np.where(better, there_s, onsets_s)
        reach = np.where(better, reach, SEARCH.shorter * reach)
        before, groups = groups, like.at(theta, onsets_s)
        gained = like.cost(before.whole) - like.cost(groups.whole)
        if number and gained < SEARCH.left and reach.max() <= SEARCH.first_step:
            break
    return onsets_s, groups


def _cost_by_move(like: Likelihood, groups: Groups) -> Vector:
    """Return the cost of the motion and the landing of each move, (moves,); of unseen ones with the break-away's."""
    silent = np.zeros(groups.rests.size)
    broken = groups.break_aways if like.run.hidden else np.zeros(groups.break_aways.size)
    costs = soft(np.concatenate([groups.motion, groups.landings, silent, broken]), like.weights.soft)
    return by_move(like.move_of, costs, len(like.moves))


def by_onsets(like: Likelihood, theta: Vector, onsets_s: Vector) -> Vector:
    """Return the derivative of each residual by the onset of its move, in periods, (rows,); 0 of what has none."""
    here = like.at(theta, onsets_s).whole
    there = like.at(theta, onsets_s + SHIFT * like.run.period_s).whole
    return np.where(like.move_of < len(like.moves), (there - here) / SHIFT, 0.0)

"""The onsets of a record's moves that suit a valve best.

An onset acts until the next one only: all are found at once, each by its own parabola, from the best of some tries. One
more simulation, with all onsets shifted, gives all their derivatives.
"""

from dataclasses import dataclass

import numpy as np

from sim.karnopp import Vector
from workbench.fit.breaking_off import go_on
from workbench.fit.likelihood import Groups, Likelihood, first_in_motion, last_in_motion, soft


@dataclass(frozen=True, slots=True, kw_only=True)
class OnsetSearch:
    """How onsets are sought."""

    reach: float = 3.0
    """Periods about where an onset shows, in which it lies: the first samples in motion are within the noise."""
    tried: tuple[float, ...] = (2.0, 1.0, 0.5, 0.0, -0.5, -1.0, -2.0)
    """Periods from where an onset shows, at which it is sought first, the last first."""
    as_good: float = 0.5
    """Nats within which the later of two is taken: a stem let go before it is pushed shows not what breaks it loose."""
    shift: float = 0.1
    """Periods by which onsets are shifted for their derivatives."""
    rounds: int = 6
    """Of parabolas: the bottom takes two, a step that is taken back two more."""
    first_step: float = 0.5
    """Periods that an onset moves at most in a round."""
    unseen_step: float = 10.0
    """The same where the stem may move before it is seen to: it has left by as much as its play takes."""
    shorter: float = 0.3
    """Factor on that where a step led higher."""


SEARCH = OnsetSearch()


def with_onsets(like: Likelihood, theta: Vector, rounds: int | None = None) -> tuple[Vector, Groups]:
    """Return the onsets, s, (moves,), that suit a valve best, (parameters,), and the residuals with them.

    Each onset acts until the next: all are found at once, each by its own parabola, and kept where they help.
    """
    earliest_s, latest_s = like.run.bounds_s(SEARCH.reach)
    period_s = like.record.period_s
    tried = [np.clip(like.run.first_onsets_s() + by * period_s, earliest_s, latest_s) for by in SEARCH.tried]
    costs = [_cost_by_move(like, like.at(theta, each)) for each in tried]
    near = np.array(costs) <= np.min(costs, axis=0) + SEARCH.as_good
    onsets_s = np.choose(np.argmax(near, axis=0), tried) if len(like.moves) else np.empty(0)
    groups = like.at(theta, onsets_s)
    reach = np.full(onsets_s.size, SEARCH.unseen_step if like.run.hidden else SEARCH.first_step)
    for _ in range((rounds or SEARCH.rounds) if onsets_s.size else 0):
        go_on()
        slopes = by_onsets(like, theta, onsets_s)
        r = groups.whole
        weight = 1.0 / np.sqrt(1.0 + (r / like.weights.soft) ** 2)
        way = -(slopes.T @ (weight * r)) / np.maximum((slopes**2).T @ weight, 1e-12)
        there_s = np.clip(onsets_s + period_s * np.clip(way, -reach, reach), earliest_s, latest_s)
        moved = like.at(theta, there_s)
        better = _cost_by_move(like, moved) < _cost_by_move(like, groups)
        onsets_s = np.where(better, there_s, onsets_s)
        reach = np.where(better, reach, SEARCH.shorter * reach)
        groups = like.at(theta, onsets_s)
    return onsets_s, groups


def _cost_by_move(like: Likelihood, groups: Groups) -> Vector:
    """Return the cost of the motion and the landing of each move, (moves,); of unseen ones with the break-away's."""
    motion = np.concatenate([[0.0], np.cumsum(soft(groups.motion, like.weights.soft))])
    landed = soft(groups.landings, like.weights.soft)
    costs = np.zeros(len(like.moves))
    for k, (first, end) in enumerate(motion_rows(like)):
        rest = like.layout.rest_after[k]
        costs[k] = motion[end] - motion[first] + (landed[rest] if rest >= 0 else 0.0)
    if like.run.hidden:
        costs[like.broken] += soft(groups.break_aways, like.weights.soft)
    return costs


def motion_rows(like: Likelihood) -> list[tuple[int, int]]:
    """Return which of the residuals in motion belong to each move, first to end (half open)."""
    moving = like.layout.moving
    return [
        (int(np.searchsorted(moving, first_in_motion(each))), int(np.searchsorted(moving, last_in_motion(each) + 1)))
        for each in like.moves
    ]


def by_onsets(like: Likelihood, theta: Vector, onsets_s: Vector) -> Vector:
    """Return the derivatives of the residuals by the onsets, in periods, (rows, moves)."""
    here = like.at(theta, onsets_s)
    there = like.at(theta, onsets_s + SEARCH.shift * like.record.period_s)
    slopes = Groups(*((b - a) / SEARCH.shift for a, b in zip(here, there, strict=True)))
    sizes = np.cumsum([0, *(each.size for each in here)])
    jacobian = np.zeros((int(sizes[-1]), onsets_s.size))
    broken = {int(k): i for i, k in enumerate(like.broken)}
    for k, (first, end) in enumerate(motion_rows(like)):
        jacobian[first:end, k] = slopes.motion[first:end]
        rest = like.layout.rest_after[k]
        if rest >= 0:
            jacobian[sizes[1] + rest, k] = slopes.landings[rest]
            blocks = np.flatnonzero(like.layout.rest_of == rest)
            jacobian[sizes[2] + blocks, k] = slopes.rests[blocks]
        if k in broken:
            jacobian[sizes[3] + broken[k], k] = slopes.break_aways[broken[k]]
    return jacobian

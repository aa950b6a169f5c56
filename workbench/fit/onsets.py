"""The onsets of a record's moves that suit a valve best.

An onset acts until the next one only: all are found at once, each by its own parabola, from the best of some tries. One
more simulation, with all onsets shifted, gives all their derivatives.
"""

import numpy as np

from sim.karnopp import Vector
from workbench.fit.breaking_off import go_on
from workbench.fit.fit_thresholds import FIT
from workbench.fit.likelihood import Groups, Likelihood, by_move, cost_of, soft, soft_weight


def with_onsets(like: Likelihood, theta: Vector, rounds: int | None = None) -> tuple[Vector, Groups]:
    """Return the onsets, s, (moves,), that suit a valve best, (parameters,), and the residuals with them.

    Each onset acts until the next: all are found at once, each by its own parabola, and kept where they help.
    """
    earliest_s, latest_s = like.run.bounds_s(FIT.onsets.reach_periods)
    period_s, onsets_s = like.run.period_s, like.run.first_onsets_s()
    tries = FIT.onsets.step_periods * np.array([4.0, 2.0, 1.0, 0.0, -1.0, -2.0, -4.0])
    open_ = np.ones(onsets_s.size, dtype=np.bool_)
    for _ in range(FIT.onsets.tries):
        tried = [
            np.where(open_, np.clip(like.run.first_onsets_s() + by * period_s, earliest_s, latest_s), onsets_s)
            for by in tries
        ]
        costs = np.array([_cost_by_move(like, like.at(theta, each)) for each in tried])
        best = np.argmax(costs <= np.min(costs, axis=0) + FIT.ends.onset_nats, axis=0)
        onsets_s = np.choose(best, tried) if best.size else onsets_s
        promised = np.min(costs, axis=0) + 2.0 * FIT.ends.onset_nats
        # A stem that a late onset before kept sliding does not wait for its own: what is not kept is tried by itself.
        open_ = _cost_by_move(like, like.at(theta, onsets_s)) > promised
        if not open_.any():
            break
    groups = like.at(theta, onsets_s)
    reach = np.full(onsets_s.size, FIT.onsets.unseen_step_periods if like.run.hidden else FIT.onsets.step_periods)
    for number in range((rounds or FIT.onsets.rounds) if onsets_s.size else 0):
        go_on()
        slopes = by_onsets(like, theta, onsets_s)
        r = groups.whole
        weight = soft_weight(r)
        downhill = by_move(like.move_of, slopes * weight * r, onsets_s.size)
        bend = by_move(like.move_of, slopes**2 * weight, onsets_s.size)
        way = -downhill / np.maximum(bend, FIT.nothing)
        there_s = np.clip(onsets_s + period_s * np.clip(way, -reach, reach), earliest_s, latest_s)
        moved = like.at(theta, there_s)
        better = _cost_by_move(like, moved) < _cost_by_move(like, groups)
        onsets_s = np.where(better, there_s, onsets_s)
        reach = np.where(better, reach, FIT.onsets.shorter_factor * reach)
        before, groups = groups, like.at(theta, onsets_s)
        gained = cost_of(before.whole) - cost_of(groups.whole)
        if number and gained < FIT.ends.onset_nats and reach.max() <= FIT.onsets.step_periods:
            break
    return onsets_s, groups


def _cost_by_move(like: Likelihood, groups: Groups) -> Vector:
    """Return the cost of the motion and the landing of each move, (moves,); of unseen ones with the break-away's."""
    silent = np.zeros(groups.rests.size)
    broken = groups.break_aways if like.run.hidden else np.zeros(groups.break_aways.size)
    costs = soft(np.concatenate([groups.motion, groups.landings, silent, broken]))
    return by_move(like.move_of, costs, len(like.moves))


def by_onsets(like: Likelihood, theta: Vector, onsets_s: Vector) -> Vector:
    """Return the derivative of each residual by the onset of its move, in periods, (rows,); 0 of what has none."""
    here = like.at(theta, onsets_s).whole
    there = like.at(theta, onsets_s + FIT.onsets.shift_periods * like.run.period_s).whole
    return np.where(like.move_of < len(like.moves), (there - here) / FIT.onsets.shift_periods, 0.0)

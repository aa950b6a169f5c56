"""The search for the most likely (ln τ, ln μ) and starts: a coarse grid, then Gauss-Newton with the step damped.

The damping rises until the sum of squares falls, as in Levenberg and Marquardt's method; the linear parameters are
eliminated at each p (variable projection). A motion that begins in a gap of the samples is started at the likeliest of
the commands that were missed there.
"""

from dataclasses import replace
from math import log

import numpy as np

from positioner.estimation.array import Array
from positioner.estimation.linear_problem import DIFFERENCE, Prior, linear_problem, sensitivities
from positioner.estimation.motion_preparation import PreparedMotion, StartInterval, thinned
from positioner.estimation.motion_segment import MotionSegment

MOST_ITERATIONS = 40
CONVERGED = 1e-3
"""A step of this many standard deviations is the last."""
GRID_DAMPING_RATIOS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Damping ratios ζ = τ / (2 sqrt μ) from which the search starts."""
GRID_PERIODS = 7
"""Natural periods / 2π, sqrt μ, from which it starts, between the samples' and the motion's."""
LEAST_MASS = log(1e-6)
"""ln of the least μ / τ^2: with m/F_v a millionth of F_v/k_s the mass is nothing."""
LARGEST_DAMPING = 1e8
"""Damping beyond which there is nothing left to gain."""


def grid_search(motions: list[PreparedMotion], guess: Array | None, prior: Prior | None) -> Array | None:
    """Return the best p, (2,), ln τ and ln μ in s and s^2, of a coarse grid and of the guess; or the prior's.

    None when at every one of them pressure would close the valve.
    """
    if prior is not None:
        return np.array(prior.mean[:2])
    thin = [thinned(each) for each in motions]
    longest = max(float(each.time_s[-1] - each.time_s[0]) for each in motions)
    shortest = min(float(np.median(np.diff(each.time_s))) for each in motions)
    candidates = [
        np.array([log(2 * damping * period), log(period * period)])
        for period in np.geomspace(max(shortest / 2, 1e-4 * longest), longest / 4, GRID_PERIODS).tolist()
        for damping in GRID_DAMPING_RATIOS
    ]
    if guess is not None and np.isfinite(guess).all():
        candidates.append(guess)
    found = [(_physical_sum(*linear_problem(thin, p, None).solved()), p) for p in candidates]
    best, p = min(found, key=lambda each: each[0])
    return p if np.isfinite(best) else None


def gauss_newton(motions: list[PreparedMotion], p: Array, prior: Prior | None) -> Array:
    """Return p = (ln τ, ln μ, starts), (2 + starts,), at the minimum of S near p, by damped Gauss-Newton.

    A start is a share 0 to 1 of its interval (`StartInterval`).
    """
    damping = 1e-3
    unknown = len(p)
    problem = linear_problem(motions, p, prior)
    linear, left = problem.solved()
    for _ in range(MOST_ITERATIONS):
        R: Array = np.asarray(np.linalg.qr(sensitivities(motions, p, problem, linear, prior), mode="r"))
        size = np.linalg.norm(R[:, -1 - unknown : -1], axis=0)
        improved = None
        while improved is None and damping < LARGEST_DAMPING:
            damped = np.zeros((unknown, R.shape[1]))
            damped[:, -1 - unknown : -1] = np.diag(damping**0.5 * size)
            tried_p = _stepped(p, _step(np.vstack((R, damped)))[-unknown:])
            tried = linear_problem(motions, tried_p, prior)
            found, remaining = tried.solved()
            if _physical_sum(found, remaining) <= left:
                improved = tried
            else:
                damping *= 10
        if improved is None:
            break
        dof = max(1, len(problem.measured) - problem.columns.shape[1] - unknown)
        converged = float(np.abs((tried_p - p) * size).max()) <= CONVERGED * (left / dof) ** 0.5
        p, problem, linear, left = tried_p, improved, found, remaining
        damping = max(damping / 10, 1e-12)
        if converged:
            break
    return p


def with_start_in_gap(segment: MotionSegment, motion: PreparedMotion, p: Array) -> PreparedMotion:
    """Return the motion begun at the likeliest of the commands that a gap may hide; as it is when there is no gap.

    Args:
        segment: that the motion was prepared from.
        motion: with a start that is known but for the gap.
        p: (2,), ln τ and ln μ to search from.
    """
    if motion.free_velocity:
        return motion
    first = int(np.searchsorted(segment.time_s, motion.time_s[0], side="right"))
    interval = StartInterval(float(segment.time_s[first - 1]), float(segment.time_s[first]))
    steps = np.diff(segment.time_s)
    period_s, gap_s = float(np.median(steps)), interval.latest_s - interval.earliest_s
    missed = round(gap_s / period_s)
    if missed < 2:
        return motion
    thin = thinned(motion)
    candidates = [interval.begin(thin, each / missed) for each in range(missed)]
    sums = [linear_problem([each], gauss_newton([each], p[:2], None), None).solved()[1] for each in candidates]
    likeliest = int(np.argmin(sums))
    if likeliest == 0:
        return motion
    jitter_s = 1.4826 * float(np.median(np.abs(steps - period_s))) / 2**0.5
    noise_m = (sums[likeliest] / max(1, len(thin.position_m) - 5)) ** 0.5
    weight = noise_m * gap_s / max(jitter_s, 1e-3 * period_s)
    return replace(motion, start_interval=replace(interval, expected=likeliest / missed, weight=weight))


def _physical_sum(linear: Array, left: float) -> float:
    """Return the sum of squares S; infinite when pressure would close the valve (g < 0)."""
    return left if linear[0] > 0 else float("inf")


def _stepped(p: Array, step: Array) -> Array:
    """Return p after a step, of which no time constant follows more than e^2, and no start leaves its interval."""
    moved = p + np.clip(step, -2.0, 2.0)
    moved[1] = max(moved[1], 2 * moved[0] + LEAST_MASS)
    moved[2:] = np.clip(moved[2:], 0.0, 1.0 - 2 * DIFFERENCE)
    return moved


def _step(R: Array) -> Array:
    """Return the least-squares solution of a triangle whose last column is the right-hand side."""
    return np.asarray(np.linalg.lstsq(R[:, :-1], R[:, -1], rcond=1e-15)[0])

"""Where a search ends: whether other onsets, or places that the record leaves open, lead lower.

The cost has edges, where a stem just sticks or just does not, and a descent may stay on one. An end is believed when
descents from places drawn from what it leaves open come to nothing lower (iterated local search):

    dz ~ N(0, S^2 C),   do = -D^-1 C_o' dz      C as of `uncertainty`, S = `spread_deviations`; onsets o follow

H = [A, C_o; C_o', D] by coordinates and onsets as of `minimiser`. Of each round's draws the cheapest is descended from.
Ends that cost no more than 1.92 above the least belong to the interval of 95 %, however narrow the curvature there.
"""

from dataclasses import replace

import numpy as np

from sim.karnopp import Vector
from workbench.fit.fit_thresholds import FIT
from workbench.fit.likelihood import Likelihood, cost_of, coupling, soft_weight
from workbench.fit.minimiser import End, descend
from workbench.fit.onsets import with_onsets
from workbench.fit.uncertainty import uncertainty


def settle(like: Likelihood, end: End) -> tuple[End, ...]:
    """Search on from the end of an eased search, by either law within moves; one end where nothing stops within them.

    At low speeds a stem may creep on or stick: whether F_s holds it then, only the record can tell.
    """
    cost = cost_of(like.at(like.theta(end.z), end.onsets_s).whole)
    if cost == end.cost:
        return (_settle_by(like, replace(end, is_eased=like.is_eased)),)
    there = descend(like, end.z, with_onsets(like, like.theta(end.z))[0])
    return _settle_by(like, there), _settle_by(like.eased, end)


def _settle_by(like: Likelihood, end: End) -> End:
    """Search on where other onsets suit the valve better than those that a search came to, as long as it pays."""
    for _ in range(FIT.ends.settle_rounds):
        onsets_s, groups = with_onsets(like, like.theta(end.z))
        if cost_of(groups.whole) > end.cost - FIT.ends.same_nats:
            break
        there = descend(like, end.z, onsets_s)
        end = min(end, there, key=lambda each: each.cost)
    return end


def search_about(like: Likelihood, end: End) -> End:
    """Search on from places that the record leaves open about an end, until none leads lower; with all as likely."""
    generator, vain, ends = np.random.default_rng(1), 0, [end]
    root, follow = uncertainty(like, end).root, _onsets_by_z(like, end)
    for _ in range(FIT.ends.most_rounds):
        if vain == FIT.ends.vain_rounds or not end.z.size:
            break
        z, onsets_s = _cheapest(like, end, root, follow, generator)
        there = descend(like, z, onsets_s)
        if there.cost < end.cost + FIT.ends.same_nats:
            there = _settle_by(like, there)
        ends.append(there)
        if there.cost < end.cost - FIT.ends.gain_nats:
            end, vain = there, 0
            root, follow = uncertainty(like, end).root, _onsets_by_z(like, end)
        else:
            vain += 1
    as_likely = tuple(each for each in ends if each is not end and each.cost < end.cost + FIT.intervals.rise_nats)
    return replace(end, as_likely=as_likely)


def _cheapest(
    like: Likelihood, end: End, root: Vector, follow: Vector, generator: np.random.Generator
) -> tuple[Vector, Vector]:
    """Return the coordinates and onsets, s, of the cheapest of some places drawn about an end."""
    normal = generator.standard_normal((FIT.ends.draws, end.z.size))
    longest = FIT.damping.longest_step
    steps = FIT.ends.spread_deviations * np.linalg.lstsq(root, normal.T)[0].T
    places = np.clip(end.z + np.clip(steps, -longest, longest), *like.bounds)
    earliest_s, latest_s = like.run.bounds_s(FIT.onsets.reach_periods)
    onsets_s = [
        np.clip(end.onsets_s + like.run.period_s * np.clip(follow @ (z - end.z), -1.0, 1.0), earliest_s, latest_s)
        for z in places
    ]
    costs = [cost_of(like.at(like.theta(z), o).whole) for z, o in zip(places, onsets_s, strict=True)]
    best = int(np.argmin(costs))
    return places[best], onsets_s[best]


def _onsets_by_z(like: Likelihood, end: End) -> Vector:
    """Return by how many periods the best onsets move with each coordinate, (moves, parameters)."""
    by_z, by_onset = np.hsplit(end.jacobian, [end.z.size])
    weight = soft_weight(end.groups.whole)
    C_o, D = coupling(like.move_of, by_z, by_onset.sum(axis=1), weight, len(like.moves))
    return np.asarray(-np.where(FIT.nothing < D, C_o / np.maximum(D, FIT.nothing), 0.0).T)

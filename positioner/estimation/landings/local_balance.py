"""The pressure that lands a slide at a position: a law known before, bent as landings are, and what is left near it.

    B(x, s) = B_0(x, s) + q_1 + q_2 s + q_3 t + q_4 t^2 + q_5 t^3 + q_6 s t + (q_7 + q_8 s) v + l_s + n_s(x)
    B_0     = κ x + s φ + offset of the straight law, or p_s(x) of an extended valve      (config/extended_valve.py)
    t       = 2 x/stroke - 1
    v       = (least way of the landings / way)^2, 1 at the most, less its mean over the landings
    q       = (Q' W Q/σ^2 + P^-1)^-1 Q' W e/σ^2             e_j = p_j - B_0(x_j, s_j)
    l_s     = what q leaves of all of the last e_j, s_j = s: the least of them if they have one sign, else 0
    n_s(x)  = Σ w_j e'_j / (w_0 + Σ w_j)                    e'_j what q and l_s leave of e_j,  s_j = s
    w_j     = exp(-((x_j - x) / h)^2 / 2) ρ^(landings of direction s since j)

A spring that hardens bends both lines alike (t^2, t^3), friction that grows over the travel makes them part (s t): two
or three numbers, which the landings of S3 give. P holds them to what such valves have; W, Huber's, counts a landing
that lies apart for less, and σ is what the others lie off by. Behind a slow I/P a slide creeps into its rest and sticks
short of its balance; a short one jumps there: v. A slide to x that missed all the same says what is missing there: the
next one lands. w_0 holds that correction back where there is little to go by. Friction that drifts makes the last
slides miss alike everywhere: l_s. Where friction is known to drift by r a
second, p_j is what it would take now, p_j + s r (t - t_j) (p_+(x_j) - p_-(x_j))/2.

All of this together stays among what was seen, B - B_0 within min(0, e_j) to max(0, e_j): no bend is carried on beyond
its landings. So a law cannot make itself worse than the valve differs from place to place
(`control/laws/slides/certificate.py`).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import exp, isnan, nan, sqrt
from typing import NamedTuple

import numpy as np

from config.extended_valve import ExtendedValve
from positioner.estimation.acceptance import Ratios
from positioner.estimation.array import Array
from positioner.estimation.landings.change_point import FINEST
from positioner.estimation.landings.landing_detector import SlideOutcome

WIDTH = 0.04
"""h, of the stroke."""
FADING = 0.7
"""ρ"""
HELD_BACK = 0.1
"""w_0"""
LATEST_LANDINGS = 3
"""Landings in a direction, of which l_s is taken."""
BENDS = (0.05, 0.05, 0.05, 0.1, 0.04, 0.03, 0.02, 0.02)
"""Of the pressure over the stroke: standard deviations of q, the root of P."""
SAME = 1e-9
"""m: a way shorter than this is none."""
FADES = 0.97
"""Factor on the weight from landing to landing."""
HUBER, ROUNDS = 2.0, 4
LARGEST_DRIFT = 0.1
"""Share of friction that a known drift is followed since a landing: a straight line goes on for no longer."""


@dataclass(frozen=True, kw_only=True)
class LocalBalance:
    """B of what is known; what the landings say is worked out when it is first asked for, and once.

    Attributes:
        ratios: of the straight law.
        landings: the latest first; of an extended valve, positions of the stem.
        stroke_m: full travel, m.
        valve: extended, in place of the straight law.
        now_s: to which friction of a valve that drifts is followed, s.
    """

    ratios: Ratios
    landings: tuple[SlideOutcome, ...]
    stroke_m: float
    valve: ExtendedValve | None = None
    now_s: float = 0.0

    def known_pa(self, position_m: float, direction: int) -> float:
        """Return B_0(x, s), Pa."""
        law = self.ratios.balance_pa if self.valve is None else self.valve.landing_pa
        return law(position_m, direction)

    def pressure_pa(self, position_m: float, direction: int, way_m: float = nan) -> float:
        """Return B(x, s), Pa, of a slide that goes so far, m; NaN: as far as the landings did."""
        bend = self._bend
        bent_pa = bend.bent_by_pa(position_m / self.stroke_m, direction, way_m)
        off_pa = bent_pa + bend.near_pa(position_m, direction, WIDTH * self.stroke_m)
        return self.known_pa(position_m, direction) + bend.seen_pa(off_pa)

    def bent_by_pa(self, position_m: float, direction: int) -> float:
        """Return by how much the landings are bent away from B_0 at a position, Pa."""
        return self._bend.bent_by_pa(position_m / self.stroke_m, direction)

    def ahead_m(self, each: SlideOutcome, swing: float) -> float:
        """Return how far a change of the command sends a stem that breaks loose, m, by B where it starts from.

        Args:
            each: what the change did.
            swing: ρ, share of its way by which the stem swings past its balance.
        """
        s, from_pa = each.direction, self.pressure_pa(each.from_m, each.direction)
        if self.valve is None:
            return s * (each.command_pa - from_pa) / -self.ratios.b_over_c / (1.0 - swing)
        followed_pa = from_pa - self.valve.landing_pa(each.from_m, s)
        return s * (self.valve.lands_m(each.command_pa - followed_pa, s) - each.from_m)

    @property
    def scatter_m(self) -> float:
        """How far slides scatter from one to the next, a standard deviation, m."""
        return self._bend.scatter_pa / -self.ratios.b_over_c

    def _off_pa(self, each: SlideOutcome) -> float:
        """Return e_j, Pa."""
        off_pa = each.command_pa - self.known_pa(each.position_m, each.direction)
        if self.valve is None or not self.valve.inverse.drift_per_s:
            return off_pa
        share = self.valve.inverse.drift_per_s * (self.now_s - each.time_s)
        up_pa, down_pa = (self.valve.landing_pa(each.position_m, s) for s in (1, -1))
        return off_pa + each.direction * min(max(share, -LARGEST_DRIFT), LARGEST_DRIFT) * 0.5 * (up_pa - down_pa)

    @cached_property
    def _bend(self) -> "_Bend":
        stroke_pa = -self.ratios.b_over_c * self.stroke_m
        return _bend(self.landings, [self._off_pa(each) for each in self.landings], self.stroke_m, stroke_pa)


class _Bend(NamedTuple):
    """What landings say of a law, Pa."""

    q: tuple[float, ...]
    least_way_m: float
    """Of the landings, ..."""
    mean_v: float
    """... and of v before it is taken off."""
    scatter_pa: float
    """Of the landings from one to the next, a standard deviation: friction that drifts is gone by, and no scatter."""
    left: tuple[tuple[tuple[float, float], ...], ...]
    """Down and up, the latest first: x_j, m, and what q leaves of e_j."""
    lately_pa: tuple[float, ...]
    """l_s"""
    least_pa: float
    most_pa: float
    """Of e_j, and 0."""

    def seen_pa(self, off_pa: float) -> float:
        """Return what of a correction has been seen, Pa: the nearest of what landings lay off the law by."""
        return min(max(off_pa, self.least_pa), self.most_pa)

    def near_pa(self, position_m: float, direction: int, width_m: float) -> float:
        """Return l_s + n_s(x), Pa."""
        weighted_pa, weights, age, lately_pa = 0.0, HELD_BACK, 1.0, self.lately_pa[direction > 0]
        for at_m, left_pa in self.left[direction > 0]:
            apart = (at_m - position_m) / width_m
            weight = age * exp(-apart * apart / 2.0)
            weighted_pa, weights, age = weighted_pa + weight * (left_pa - lately_pa), weights + weight, age * FADING
        return lately_pa + weighted_pa / weights

    def bent_by_pa(self, share: float, direction: int, way_m: float = nan) -> float:
        """Return what q says at a share of the stroke, Pa, of a slide that goes so far, m; NaN: as landings did."""
        t, s = 2.0 * share - 1.0, direction
        v = 0.0 if isnan(way_m) else min(1.0, self.least_way_m / max(way_m, SAME)) ** 2 - self.mean_v
        level, friction, slope, square, cube, parting, short, short_friction = self.q
        bent_pa = t * (slope + t * (square + t * cube) + parting * s)
        return self.seen_pa(level + friction * s + bent_pa + v * (short + short_friction * s))


_STRAIGHT = (0.0,) * len(BENDS)


def _bend(landings: Sequence[SlideOutcome], off_pa: Sequence[float], stroke_m: float, stroke_pa: float) -> _Bend:
    """Return what landings say that lie off by e_j, Pa; of the stroke, m, and the pressure over it, Pa."""
    if not landings:
        return _Bend(_STRAIGHT, 0.0, 0.0, FINEST * stroke_pa, ((), ()), (0.0, 0.0), 0.0, 0.0)
    e = np.array(off_pa)
    s = np.array([float(each.direction) for each in landings])
    t = np.array([2.0 * each.position_m / stroke_m - 1.0 for each in landings])
    went_m = np.array([max(SAME, abs(each.position_m - each.from_m)) for each in landings])
    v = (went_m.min() / went_m) ** 2
    mean_v = float(v.mean())
    v -= mean_v
    Q = np.column_stack((np.ones(s.size), s, t, t**2, t**3, s * t, v, s * v))
    known: Array = np.power(FADES, np.arange(s.size, dtype=float))
    held = np.diag((np.array(BENDS) * stroke_pa) ** -2.0)
    q: Array = np.zeros(len(BENDS))
    weights, sigma_pa = known, max(FINEST * stroke_pa, float(np.sqrt(np.mean(e**2))))
    for _ in range(ROUNDS):
        normal = (Q.T * weights) / sigma_pa**2
        q = np.linalg.solve(normal @ Q + held, normal @ e)
        off = np.abs(e - Q @ q)
        sigma_pa = max(FINEST * stroke_pa, 1.4826 * float(np.median(off)))
        weights = known * np.minimum(1.0, HUBER * sigma_pa / np.maximum(off, 1e-9))
    left_pa = e - Q @ q
    at_m = np.array([each.position_m for each in landings])
    left = tuple(tuple(zip(at_m[s == way].tolist(), left_pa[s == way].tolist(), strict=True)) for way in (-1, 1))
    lately_pa = tuple(_alike(left_pa[s == way][:LATEST_LANDINGS].tolist()) for way in (-1, 1))
    scatter_pa = max(FINEST * stroke_pa, _scatter_pa(left_pa[s == way] for way in (-1, 1)))
    return _Bend(
        tuple(q.tolist()),
        float(went_m.min()),
        mean_v,
        scatter_pa,
        left,
        lately_pa,
        min(0.0, float(e.min())),
        max(0.0, float(e.max())),
    )


def _scatter_pa(ways_pa: Iterable[Array]) -> float:
    """Return by what slides scatter, a standard deviation, from what successive ones in each direction differ by."""
    apart_pa = np.abs(np.concatenate([np.diff(each) for each in ways_pa]))
    return 1.4826 * float(np.median(apart_pa)) / sqrt(2.0) if apart_pa.size else 0.0


def _alike(missed_pa: Sequence[float]) -> float:
    """Return what all have in common: the least of them, if all have one sign."""
    if len(missed_pa) < LATEST_LANDINGS:
        return 0.0
    return max(0.0, min(missed_pa)) + min(0.0, max(missed_pa))

"""The pressure that lands a slide at a position: the straight law, bent as its landings are, and what is left near it.

    B(x, s) = κ x + s φ + offset + q_1 + q_2 s + q_3 t + q_4 t^2 + q_5 t^3 + q_6 s t + l_s + n_s(x)
    t       = 2 x/stroke - 1
    q       = (Q' W Q/σ^2 + P^-1)^-1 Q' W e/σ^2             e_j = p_j - (κ x_j + s_j φ + offset)
    l_s     = what q and g_s leave of all of the last e_j, s_j = s: the least of them if they have one sign, else 0
    n_s(x)  = Σ w_j e'_j / (w_0 + Σ w_j)                    e'_j what q, g_s and l_s leave of e_j,  s_j = s
    w_j     = exp(-((x_j - x) / h)^2 / 2) ρ^(landings of direction s since j)

    B(x_0, x, s) = B(x, s) - s κ g_s(abs(x - x_0))       of a slide from x_0: g_s of what q leaves (short_slides.py)

A spring that hardens bends both lines alike (t^2, t^3), friction that grows over the travel makes them part (s t): two
or three numbers, which the landings of S3 give. P holds them to what such valves have; W, Huber's, counts a landing
that lies apart for less, and that of a short slide, and σ is what the others lie off by. A slide to x that missed all
the same says what is missing there: the next one lands. w_0 holds that correction back where there is little to go by.
Friction that drifts makes the last slides miss alike everywhere: l_s.

All of this together stays among what was seen, B(x, s) - (κ x + s φ + offset) within min(0, e_j) to max(0, e_j): no
bend is carried on beyond its landings. So a law cannot make itself worse than the valve differs from place to place
(`control/laws/slides/certificate.py`).
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from math import sqrt
from typing import NamedTuple

import numpy as np

from positioner.estimation.acceptance import Ratios
from positioner.estimation.array import Array
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.mean_nearby import mean_nearby
from positioner.estimation.landings.parting import FINEST
from positioner.estimation.landings.short_slides import Sent, beyond_m, jumped_m, sent

WIDTH = 0.04
"""h, of the stroke."""
FADING = 0.7
"""ρ"""
HELD_BACK = 0.1
"""w_0"""
LATEST_LANDINGS = 3
"""Landings in a direction, of which l_s is taken."""
BENDS = (0.05, 0.05, 0.05, 0.1, 0.04, 0.03)
"""Of the pressure over the stroke: standard deviations of q, the root of P."""
SHORT, SHORTEST = 3.0, 0.5
"""Of the shortest slide: one that went as far counts half; of F_c/k_s: the shortest is taken for no longer."""
SAME = 1e-9
"""m: positions nearer than this are one."""
FEWEST_BEND_LANDINGS = 5
"""Landings: fewer do not say how they are bent."""
FADES = 0.97
"""Factor on the weight from landing to landing."""
HUBER, ROUNDS = 2.0, 4


def ahead_m(each: SlideOutcome, ratios: Ratios, landings: Sequence[SlideOutcome], stroke_m: float) -> float:
    """Return how far a change of the command sends a stem that breaks loose, m, by the balance where it starts from.

    Args:
        each: the change, and where the stem was.
        ratios, landings, stroke_m: as of `landing_pa`.
    """
    ahead_pa = each.command_pa - landing_pa(each.from_m, each.direction, ratios, landings, stroke_m)
    return each.direction * ahead_pa / -ratios.b_over_c


def landing_pa(
    position_m: float, direction: int, ratios: Ratios, landings: Sequence[SlideOutcome], stroke_m: float
) -> float:
    """Return the pressure, Pa, under which a slide up (+1) or down (-1) lands at a position, m.

    Args:
        position_m: where it is to land.
        direction: of the slide.
        ratios: the straight law.
        landings: the latest first.
        stroke_m: full travel.
    """
    return sliding_pa(position_m, position_m, direction, ratios, landings, stroke_m)


def sliding_pa(
    from_m: float,
    to_m: float,
    direction: int,
    ratios: Ratios,
    landings: Sequence[SlideOutcome],
    stroke_m: float,
) -> float:
    """Return the pressure, Pa, under which a slide from rest at a position lands at another, m.

    Args:
        from_m, to_m: where it begins and lands.
        direction, ratios, landings, stroke_m: as of `landing_pa`.
    """
    bend = _bend(ratios, tuple(landings), stroke_m)
    way, apart_m = bend.ways[direction > 0], WIDTH * stroke_m
    near_pa = mean_nearby(((each_m - to_m) / apart_m for each_m in way.at_m), way.left_pa, FADING, HELD_BACK)
    way_m = abs(to_m - from_m)
    short_pa = direction * ratios.b_over_c * beyond_m(way_m, way.sent) if way_m else 0.0
    off_pa = bend.bent_by_pa(to_m / stroke_m, direction) + way.lately_pa + near_pa + short_pa
    return ratios.balance_pa(to_m, direction) + bend.seen_pa(off_pa)


def bent_by_pa(
    position_m: float, direction: int, ratios: Ratios, landings: Sequence[SlideOutcome], stroke_m: float
) -> float:
    """Return by how much the landings are bent away from the straight law at a position, Pa; as of `landing_pa`."""
    return _bend(ratios, tuple(landings), stroke_m).bent_by_pa(position_m / stroke_m, direction)


def scatter_m(ratios: Ratios, landings: Sequence[SlideOutcome], stroke_m: float) -> float:
    """Return how far slides scatter from one to the next, a standard deviation, m; arguments as of `landing_pa`."""
    return _bend(ratios, tuple(landings), stroke_m).scatter_pa / -ratios.b_over_c


class _Way(NamedTuple):
    """The landings in one direction, the latest first."""

    lately_pa: float
    """l_s"""
    sent: tuple[Sent, ...]
    at_m: tuple[float, ...]
    left_pa: tuple[float, ...]
    """Of e_j, by q, g_s and l_s."""


class _Bend(NamedTuple):
    """What landings say of a straight law, Pa."""

    q: tuple[float, ...]
    scatter_pa: float
    """Of the landings from one to the next, a standard deviation: friction that drifts is gone by, and no scatter."""
    ways: tuple[_Way, ...]
    """Down and up."""
    least_pa: float
    most_pa: float
    """Of e_j, and 0."""

    def seen_pa(self, off_pa: float) -> float:
        """Return what of a correction has been seen, Pa: the nearest of what landings lay off the straight law by."""
        return min(max(off_pa, self.least_pa), self.most_pa)

    def bent_by_pa(self, share: float, direction: int) -> float:
        """Return what q says at a share of the stroke, Pa."""
        t, s = 2.0 * share - 1.0, direction
        level, friction, slope, square, cube, parting = self.q
        return self.seen_pa(level + friction * s + t * (slope + t * (square + t * cube) + parting * s))


_STRAIGHT = (0.0,) * len(BENDS)


@lru_cache(maxsize=4)
def _bend(ratios: Ratios, landings: tuple[SlideOutcome, ...], stroke_m: float) -> _Bend:
    """Return what landings say; q is zeros where there are too few."""
    off_pa = [each.command_pa - ratios.balance_pa(each.position_m, each.direction) for each in landings]
    seen_pa = (min(0.0, *off_pa), max(0.0, *off_pa)) if off_pa else (0.0, 0.0)
    if len(landings) < FEWEST_BEND_LANDINGS:
        return _Bend(_STRAIGHT, FINEST * -ratios.b_over_c * stroke_m, tuple(_few(landings, ratios)), *seen_pa)
    s = np.array([float(each.direction) for each in landings])
    t = np.array([2.0 * each.position_m / stroke_m - 1.0 for each in landings])
    e = np.array(off_pa)
    Q = np.column_stack((np.ones(s.size), s, t, t**2, t**3, s * t))
    stroke_pa = -ratios.b_over_c * stroke_m
    friction_m = ratios.k_over_c / ratios.b_over_c
    known: Array = np.power(FADES, np.arange(s.size, dtype=float)) * _weights_by_length(landings, s, friction_m)
    held = np.diag((np.array(BENDS) * stroke_pa) ** -2.0)
    weights: Array = known
    sigma_pa = max(FINEST * stroke_pa, float(np.sqrt(np.mean(e**2))))
    q: Array = np.zeros(len(BENDS))
    for _ in range(ROUNDS):
        normal = (Q.T * weights) / sigma_pa**2
        q = np.linalg.solve(normal @ Q + held, normal @ e)
        off = np.abs(e - Q @ q)
        sigma_pa = max(FINEST * stroke_pa, 1.4826 * float(np.median(off)))
        weights = known * np.minimum(1.0, HUBER * sigma_pa / np.maximum(off, 1e-9))
    left_pa = e - Q @ q
    landed = list(zip(landings, left_pa.tolist(), strict=True))
    ways = (_way([each for each in landed if each[0].direction == way], -ratios.b_over_c) for way in (-1, 1))
    scatter_pa = _scatter_pa(left_pa[s == way] for way in (-1.0, 1.0))
    return _Bend(tuple(q.tolist()), max(FINEST * stroke_pa, scatter_pa), tuple(ways), *seen_pa)


def _weights_by_length(landings: Sequence[SlideOutcome], s: Array, friction_m: float) -> Array:
    """Return the weight of each landing by how far its slide went: where a short one lands is not the balance alone.

    Short is what is not far beyond the shortest in its direction; that may itself be long, but not beyond friction.
    """
    went_m: Array = np.array([max(SAME, abs(each.position_m - each.from_m)) for each in landings])
    shortest_m: Array = np.array([min(went_m[s == way].min(), SHORTEST * friction_m) for way in s])
    weights: Array = 1.0 / (1.0 + (SHORT * shortest_m / went_m) ** 2)
    return weights


def _few(landings: Sequence[SlideOutcome], ratios: Ratios) -> Iterator[_Way]:
    """Yield what a few landings say of each direction, down and up: they tell no way from a place."""
    for way in (-1, 1):
        landed = [each for each in landings if each.direction == way]
        left_pa = (each.command_pa - ratios.balance_pa(each.position_m, way) for each in landed)
        yield _Way(0.0, (), tuple(each.position_m for each in landed), tuple(left_pa))


def _way(landed: Sequence[tuple[SlideOutcome, float]], slope_pa_per_m: float) -> _Way:
    """Return what landings in one direction say, each given with what q leaves of it, Pa."""
    slid = [(each, off_pa) for each, off_pa in landed if each.position_m != each.from_m]
    slides = sent(slid, slope_pa_per_m)
    left_pa = [
        off_pa + each.direction * slope_pa_per_m * jumped_m(slide.sent_m, slides)
        for (each, off_pa), slide in zip(slid, slides, strict=True)
    ]
    lately_pa = _alike(left_pa[:LATEST_LANDINGS])
    return _Way(
        lately_pa, slides, tuple(each.position_m for each, _ in slid), tuple(each - lately_pa for each in left_pa)
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

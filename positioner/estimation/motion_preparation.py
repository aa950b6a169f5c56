"""A motion prepared for the fit: its rows from where it begins, averaged in blocks when long, and the rest before it.

What a motion knows of its beginning is worth much, for m and F_v are separated in the first milliseconds. When a held
pressure jumps, and the stem leaves its rest there, it starts at that instant with v_0 = 0 from where it rested, x_0, of
which each sample at rest is a measurement. Where no single jump stands out, the stem breaks away by the drop from F_s
to F_c, whose course (Stribeck, presliding) is no part of this model: then, and when the beginning was not measured, x_0
and v_0 are free.
"""

from dataclasses import dataclass, replace
from enum import Enum, auto
from math import inf, nextafter

import numpy as np

from positioner.estimation.array import Array
from positioner.estimation.motion_segment import MotionSegment

MOST_ROWS = 8000
"""A longer motion is averaged in blocks. A block of length T_b shifts μ by T_b^2/24: with 8000 of them nothing."""
START_ROWS = 300
"""Rows of the search for a start, in blocks that grow from the beginning, where m and F_v are separated."""
CLEAR = 0.05
"""A jump of the pressure stands out when every other near it is a smaller share of it."""


class Beside(Enum):
    """What may act beside the model: a force of one direction, as a preload; a sensor that drifts, linear in time."""

    NOTHING = auto()
    PRELOAD = auto()
    DRIFT = auto()


@dataclass(frozen=True, slots=True)
class PreparedMotion:
    """A motion in rows for the fit, SI units.

    Attributes:
        direction: +1 up, -1 down.
        time_s: (N + 1,), the start in front.
        pressure_pa: (N + 1,), that at the start in front; held: of the interval before each.
        position_m: (N,), measured, or the means of blocks.
        weight: (N,), square roots of the samples in each row.
        rest_m: where the stem rested before.
        rest_count: samples that say so; 0 when it was not measured, or is not the start.
        free_velocity: whether position and velocity at the start are unknown.
        held: how the pressure goes between the rows.
        start_interval: where the start is unknown; None: `time_s[0]`.
        beside: what may act beside the model.
    """

    direction: int
    time_s: Array
    pressure_pa: Array
    position_m: Array
    weight: Array
    rest_m: float
    rest_count: int
    free_velocity: bool
    held: bool
    start_interval: "StartInterval | None" = None
    beside: Beside = Beside.NOTHING


@dataclass(frozen=True, slots=True)
class StartInterval:
    """The instants, s, between which a motion began.

    In a gap of held pressure the commands that were missed came one period after another, give or take the jitter:
    `expected` is the likeliest of them, a share of the interval, and `weight` the noise in m over its uncertainty.
    """

    earliest_s: float
    latest_s: float
    expected: float = 0.0
    weight: float = 0.0

    def begin(self, motion: PreparedMotion, share: float) -> PreparedMotion:
        """Return the motion begun at a share, 0 to 1, of the interval."""
        time_s = motion.time_s.copy()
        time_s[0] = self.earliest_s + share * (self.latest_s - self.earliest_s)
        return replace(motion, time_s=time_s)


def prepared(segment: MotionSegment, *, held: bool, beside: Beside = Beside.NOTHING) -> PreparedMotion:
    """Return the rows of a motion, from the jump of a held pressure that began it, or from where it surely moves."""
    jump = _initial_jump(segment, held)
    from_rest = jump is not None
    first = jump + 1 if jump is not None else (segment.begins + 2 if segment.begins else 0)
    time_s = segment.time_s[first:]
    pressure_pa = segment.pressure_pa[first:]
    position_m = segment.position_m[first:]
    rest = segment.position_m[:first] if from_rest else position_m[:0]
    start_s, start_pa = float(segment.time_s[max(0, first - 1)]), float(segment.pressure_pa[max(0, first - 1)])
    weight = np.ones(len(time_s))
    if len(time_s) > MOST_ROWS:
        edges = _edges(len(time_s), MOST_ROWS, growing=False)
        weight = np.diff(np.append(edges, len(time_s))).astype(np.float64)
        coarse_s = np.add.reduceat(time_s, edges) / weight
        pressure_pa = _mean_pressure(start_s, start_pa, time_s, pressure_pa, coarse_s, held)
        position_m = np.add.reduceat(position_m, edges) / weight
        time_s = coarse_s
    if not from_rest:
        # The first sample is a row like the others; far from the zero of the clock the least that a time can be before.
        start_s = min(start_s - 1e-9 * float(time_s[-1] - start_s), nextafter(start_s, -inf))
    count = _independent_count(rest, position_m)
    return PreparedMotion(
        direction=segment.direction,
        time_s=np.append(start_s, time_s),
        pressure_pa=np.append(start_pa, pressure_pa),
        position_m=position_m,
        weight=np.sqrt(weight),
        rest_m=float(rest.mean()) if count else 0.0,
        rest_count=count,
        free_velocity=not from_rest,
        held=held,
        beside=beside,
    )


def _initial_jump(segment: MotionSegment, held: bool) -> int | None:
    """Return the sample after which the pressure's jump set the stem in motion; None when no one jump stands out."""
    if segment.begins == 0 or not held:
        return None
    around = slice(segment.earliest, segment.begins + 3)
    jumps = np.abs(np.diff(segment.pressure_pa[around]))
    order = np.argsort(-jumps, kind="stable")
    if len(jumps) == 0 or (len(jumps) > 1 and jumps[order[1]] > CLEAR * jumps[order[0]]) or jumps[order[0]] == 0:
        return None
    return segment.earliest + int(order[0])


def _independent_count(rest: Array, moving: Array) -> int:
    """Return how many independent samples those at rest are: all rounded to one code they are one."""
    if len(rest) < 2:
        return len(rest)
    noise = float(np.median(np.abs(np.diff(moving, 3)))) / 3 if len(moving) > 6 else 0.0
    return len(rest) if float(rest.std()) >= 0.3 * noise else 1


def thinned(motion: PreparedMotion) -> PreparedMotion:
    """Return the motion in some `START_ROWS` rows, in blocks that grow from the beginning: enough to find a start."""
    count = len(motion.position_m)
    if count <= START_ROWS:
        return motion
    edges = _edges(count, START_ROWS // 2, growing=True)
    number = np.diff(np.append(edges, count)).astype(np.float64)
    time_s, start_s = motion.time_s[1:], float(motion.time_s[0])
    coarse_s = np.add.reduceat(time_s, edges) / number
    pressure_pa = _mean_pressure(
        start_s, float(motion.pressure_pa[0]), time_s, motion.pressure_pa[1:], coarse_s, motion.held
    )
    return replace(
        motion,
        time_s=np.append(start_s, coarse_s),
        pressure_pa=np.append(motion.pressure_pa[0], pressure_pa),
        position_m=np.add.reduceat(motion.position_m, edges) / number,
        weight=np.sqrt(np.add.reduceat(motion.weight**2, edges)),
    )


def _edges(count: int, rows: int, *, growing: bool) -> "np.typing.NDArray[np.int64]":
    """Return the first samples of the blocks: even ones, or single samples first and then ever longer blocks."""
    if not growing:
        return np.arange(0, count, -(-count // rows), dtype=np.int64)
    later = np.geomspace(rows // 3, count - 1, rows).astype(np.int64)
    return np.unique(np.concatenate((np.arange(rows // 3, dtype=np.int64), later)))


def _mean_pressure(
    start_s: float, start_pa: float, time_s: Array, pressure_pa: Array, at_s: Array, held: bool
) -> Array:
    """Return the pressure for coarser instants: held, the means between them; linear, the values there."""
    times = np.append(start_s, time_s)
    if not held:
        return np.asarray(np.interp(at_s, times, np.append(start_pa, pressure_pa)))
    integral = np.append(0.0, np.cumsum(np.diff(times) * pressure_pa))
    at = np.append(0.0, np.interp(at_s, times, integral))
    return np.asarray(np.diff(at) / np.diff(np.append(start_s, at_s)))

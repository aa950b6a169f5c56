"""Methods of the literature, which vote beside the likelihood and are shown with their figures.

    He         half cycles of OP: a triangle fits better than a half sine  (He et al., Ind. Eng. Chem. Res. 2007)
    Hagglund   half cycles of PV - SP: a square fits better than a half sine  (Control Eng. Practice 2011)
    Horch      OP and PV a quarter of a cycle apart: their cross-correlation is odd  (Control Eng. Practice 1999)
    Kano       OP moves and PV does not: the share of such samples  (DYCOPS 2004, method A)

Each gives an index and, by its own paper's limits, a vote: sticks, no, or open.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from workbench.loops.loop_record import Array, LoopRecord, averaged
from workbench.loops.oscillation import Oscillation, without_trend

FEWEST_HALVES = 4
"""Half cycles, below which a shape is chance."""
HE_STICKS, HE_NO = 0.6, 0.4
HORCH_ODD, HORCH_EVEN = 2.0 / 3.0, 1.0 / 3.0
KANO_STICKS = 0.25
"""Limits of the papers."""


@dataclass(frozen=True, slots=True)
class Vote:
    """What a method says: its index, and sticks, no or open."""

    method: str
    index: float
    says: str


def votes(record: LoopRecord, oscillation: Oscillation) -> tuple[Vote, ...]:
    """Return what the methods say of a record."""
    every = max(1, int(oscillation.period_s / record.period_s / 60.0))
    op, pv = averaged(record.op_pct, every), averaged(record.pv, every)
    sp = np.zeros(pv.size) if record.sp is None else averaged(record.sp, every)
    cycle = oscillation.period_s / record.period_s / every
    return he(op, cycle), hagglund(pv - sp, cycle), horch(op, pv, cycle), kano(op, pv, cycle)


def he(op: Array, cycle: float) -> Vote:
    """Return He's index, 0 to 1, of an output, (n,), of `cycle` rows a cycle."""
    sine, triangle = _misfits(op, cycle, _triangle_misfit) or (1.0, 1.0)
    index = float(sine / max(sine + triangle, 1e-300))
    return Vote("He", index, "sticks" if index > HE_STICKS else "no" if index < HE_NO else "open")


def hagglund(error: Array, cycle: float) -> Vote:
    """Return Hägglund's index, -1 to 1, of a control error, (n,)."""
    found = _misfits(error, cycle, lambda half, _: _misfit(half, np.ones(half.size)))
    if found is None:
        return Vote("Hagglund", 0.0, "open")
    sine, square = found
    index = float((sine - square) / max(sine + square, 1e-300))
    return Vote("Hagglund", index, "sticks" if index > 0.0 else "no")


def _misfits(values: Array, cycle: float, other: Callable[[Array, Array], float]) -> tuple[float, float] | None:
    """Return what half sines leave of the half cycles, and what another shape does; None of too few of them."""
    halves = _half_cycles(values, cycle)
    if len(halves) < FEWEST_HALVES:
        return None
    return sum(_misfit(half, np.sin(np.pi * at)) for half, at in halves), sum(other(half, at) for half, at in halves)


def horch(op: Array, pv: Array, cycle: float) -> Vote:
    """Return Horch's index, 0 (even) to 1 (odd), of output and process value, (n,) each."""
    first, second = without_trend(op), without_trend(pv)
    reach = min(int(0.5 * cycle), op.size // 3)
    scale = max(float(np.sqrt((first @ first) * (second @ second))), 1e-300)
    lags = range(-reach, reach + 1)
    correlation = np.array([_product(first, second, lag) for lag in lags]) / scale
    least, at_zero = float(np.abs(correlation).max()), abs(float(correlation[reach]))
    index = abs(at_zero - least) / max(at_zero + least, 1e-300)
    return Vote("Horch", index, "sticks" if index > HORCH_ODD else "no" if index < HORCH_EVEN else "open")


def kano(op: Array, pv: Array, cycle: float) -> Vote:
    """Return Kano's share of samples in which OP moves and PV rests, 0 to 1."""
    window = max(2, int(cycle / 12.0))
    if op.size <= 2 * window:
        return Vote("Kano", 0.0, "open")
    moves = [np.abs(each[window:] - each[:-window]) / max(float(each.std()), 1e-300) for each in (op, pv)]
    index = float(((moves[0] > 0.25) & (moves[1] < 0.1)).mean())
    return Vote("Kano", index, "sticks" if index > KANO_STICKS else "no")


def _product(first: Array, second: Array, lag: int) -> float:
    return float(first[lag:] @ second[: second.size - lag] if lag >= 0 else first[:lag] @ second[-lag:])


def _half_cycles(values: Array, cycle: float) -> list[tuple[Array, Array]]:
    """Return the half cycles of a signal between its zero crossings, each with its place in it, 0 to 1."""
    window = max(1, int(cycle / 12.0))
    centred = values - _moving_mean(values, max(3, int(1.5 * cycle)))
    smooth = _moving_mean(centred, window)
    crossings = np.flatnonzero(np.sign(smooth[:-1]) * np.sign(smooth[1:]) < 0) + 1
    halves = [centred[begin:end] for begin, end in pairwise(crossings.tolist())]
    long_enough = [half for half in halves if half.size >= max(5, 0.2 * cycle)]
    return [(half * np.sign(half.mean()), (np.arange(half.size) + 0.5) / half.size) for half in long_enough]


def _moving_mean(values: Array, window: int) -> Array:
    padded = np.concatenate([np.full(window, values[0]), values, np.full(window, values[-1])])
    return np.asarray(np.convolve(padded, np.ones(window) / window, "same")[window : window + values.size])


def _misfit(half: Array, shape: Array) -> float:
    return float(((half - (half @ shape) / (shape @ shape) * shape) ** 2).sum())


def _triangle_misfit(half: Array, along: Array) -> float:
    """Return the misfit of the best triangle, its peak anywhere in the middle six tenths."""
    shape: Callable[[float], Array] = lambda peak: np.minimum(along / peak, (1.0 - along) / (1.0 - peak))  # noqa: E731
    return min(_misfit(half, shape(peak)) for peak in np.linspace(0.2, 0.8, 13).tolist())

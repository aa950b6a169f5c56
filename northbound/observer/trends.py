"""The last minutes of a valve as it was polled: ring buffers, where a gap is a gap, and the states as bands.

A reading that did not come is a row of NaN, so that a line breaks there: nothing is drawn between.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from config.codes import State
from config.recording import Column
from northbound.observer.waiting_reference import waiting_reference

SHOWN = {
    "reference_m": "reference_in_force",
    "position_m": "position_m",
    "pressure_pa": "pressure",
    "command_pa": "command",
    "state": "state",
}
"""Columns, by the register that each comes from; a reference is served in p.u."""
WAITING = "waiting_m"
"""The column of a reference that waits."""
COLUMNS = (*SHOWN, WAITING)


@dataclass(frozen=True, slots=True)
class Band:
    """A stretch of time, s, in one state."""

    begin_s: float
    end_s: float
    state: State


class Trend:
    """The last `capacity` readings: times, s, and the columns of `COLUMNS`, SI units."""

    def __init__(self, capacity: int) -> None:
        self._rows = np.full((capacity, 1 + len(COLUMNS)), np.nan)
        self._count = 0

    def append(self, time_s: float, values: Mapping[str, float], stroke_m: float) -> None:
        """Take a reading; what it does not have, and a measurement that is none, is NaN."""
        row = {name: values.get(register, np.nan) for name, register in SHOWN.items()}
        row["reference_m"] *= stroke_m
        waiting_pu = waiting_reference(values)
        self._enter(time_s, [*row.values(), np.nan if waiting_pu is None else waiting_pu * stroke_m])

    def gap(self, time_s: float) -> None:
        """Break the lines: nothing is known of this moment."""
        self._enter(time_s, [np.nan] * len(COLUMNS))

    def since(self, begin_s: float) -> dict[str, Column]:
        """Return the columns after a time, `time_s` and those of `COLUMNS`, (n,) each, oldest first."""
        capacity = len(self._rows)
        order = np.arange(max(0, self._count - capacity), self._count) % capacity
        rows = self._rows[order]
        rows = rows[rows[:, 0] > begin_s]
        return {name: rows[:, index].copy() for index, name in enumerate(("time_s", *COLUMNS))}

    def _enter(self, time_s: float, row: list[float]) -> None:
        self._rows[self._count % len(self._rows)] = (time_s, *row)
        self._count += 1


def bands(time_s: Column, state: Column) -> list[Band]:
    """Return the runs of one state, times (n,), s, and states (n,); none where the state is NaN.

    >>> [(each.begin_s, each.end_s, each.state.name) for each in bands(np.arange(4.0), np.array([0, 0, 1, np.nan]))]
    [(0.0, 2.0, 'S0_START'), (2.0, 3.0, 'S1_UP')]
    """
    if not len(time_s):
        return []
    known = np.where(np.isfinite(state), state, -1.0)
    edges = [0, *(np.flatnonzero(np.diff(known)) + 1).tolist(), len(known)]
    runs = [(begin, min(end, len(known) - 1), int(known[begin])) for begin, end in pairwise(edges)]
    numbers = {int(each) for each in State}
    return [
        Band(float(time_s[begin]), float(time_s[end]), State(number))
        for begin, end, number in runs
        if number in numbers
    ]


def thin_columns(columns: Mapping[str, Column], step_s: float) -> dict[str, Column]:
    """Return at most three rows a step of time, s: the least and the greatest position in it, and where one is missing.

    >>> rows = {"time_s": np.array([0.0, 0.1, 0.2, 1.0, 2.0]), "position_m": np.array([3.0, 1.0, 2.0, 5.0, np.nan])}
    >>> thin_columns(rows, 1.0)["position_m"].tolist()
    [3.0, 1.0, 5.0, nan]
    """
    time_s, position_m = columns["time_s"], columns["position_m"]
    if not len(time_s):
        return dict(columns)
    steps = np.floor(time_s / step_s)
    order = np.lexsort((position_m, steps))  # within a step by position, what is missing last
    begins = np.concatenate(([0], np.flatnonzero(np.diff(steps)) + 1))
    counts = np.diff(np.concatenate((begins, [len(steps)])))
    measured = np.add.reduceat(np.isfinite(position_m).astype(np.intp), begins)
    some, gaps = measured > 0, measured < counts
    ends = (begins[some], (begins + measured - 1)[some], (begins + measured)[gaps])
    kept = np.unique(order[np.concatenate(ends)])
    return {name: column[kept] for name, column in columns.items()}

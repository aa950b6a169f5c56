"""Rows in the order of their time: newest first, in disorder, twice, across midnight, in the hour that a clock repeats.

What can be told is put right and told; what cannot is refused:

- most steps go back: the file is newest first, and is turned round;
- times of day without a date that fall by more than half a day: midnight;
- local times that fall by an hour less a sample, once: the clock went back at the end of summer time, and the hour
  stands twice; from there on an hour is added; by less than an hour, in a night to a Sunday: the same, and a pause;
- rows that are the same in time and all values: kept once;
- rows out of order that fall into place: sorted. They do when no two then lie closer than half of what rows in order
  do;
- a clock that was set back now and then, whose rows would not fall into place: left as they are, for the workbench,
  which cuts there;
- rows of one time and different values: their order is not known, so they are refused.
"""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from config.errors import InputError
from workbench.imports.column_clock import Clock

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.intp]
HOUR_S = 3600.0
DAY_S = 86400.0
SUNDAY, CHANGED_BEFORE_H = 6, 4
"""Clocks are set back on a Sunday, before this hour of theirs."""
SHUFFLED = 0.3
"""Share of steps back from which on rows are in no order at all."""
SET_BACK_TOLERATED = 0.01
"""Part of the rows at which a clock may be set back before the time is no clock at all."""


def in_order(
    path: Path, clock: Clock, columns: Mapping[str, Array], lines: Sequence[int]
) -> tuple[Array, dict[str, Array], dict[str, str]]:
    """Return the time of the rows that are kept, their columns, and what was done, by key.

    Args:
        path: for messages.
        clock: when the rows are, n of them, as read.
        columns: of n, by name, NaN where missing.
        lines: (n,), where each row stands in the file.

    Raises:
        InputError: rows of one time with different values, or time that is no clock.
    """
    time_s, values, daily = clock.time_s, list(columns.values()), clock.daily
    said: dict[str, str] = {}
    rows: Rows = np.arange(len(time_s))
    steps = np.diff(time_s)
    if (steps < 0).sum() > 0.5 * max(1, (steps != 0).sum()) and not daily:
        rows = rows[::-1]
        said["order"] = "newest first; turned round"
    t = time_s[rows]
    if daily:
        t = _over_midnight(t, said)
    elif clock.local and clock.origin_s is not None:
        t = _over_the_hour_twice(t, clock.origin_s - time_s[0], said)
    once = _first_of_repeated(t, values, rows)
    if dropped := int((~once).sum()):
        said["repeated rows"] = f"{dropped} left out"
        t, rows = t[once], rows[once]
    t, rows = _sort_rows(t, rows, said)
    _require_a_clock(path, t, rows, lines)
    return t, {name: column[rows] for name, column in columns.items()}, said


def _over_midnight(t: Array, said: dict[str, str]) -> Array:
    days = np.cumsum(np.append(0.0, np.diff(t) < -DAY_S / 2))
    if days[-1]:
        said["midnight"] = f"times of day pass it {int(days[-1])} times"
    return t + DAY_S * days


def _over_the_hour_twice(t: Array, begin_s: float, said: dict[str, str]) -> Array:
    """Return local times, from `begin_s` on the clock, with an hour more from where, once, it went back by one."""
    steps = np.diff(t)
    back = np.flatnonzero(steps < 0)
    forward = steps[steps > 0]
    if back.size != 1 or not forward.size:
        return t
    at = int(back[0])
    rest_s = steps[at] + HOUR_S
    begun = datetime.fromtimestamp(begin_s + t[at], UTC)
    at_night = begun.weekday() == SUNDAY and begun.hour < CHANGED_BEFORE_H
    if rest_s < 0 or (rest_s > 3.0 * float(np.median(forward)) and not at_night):
        return t
    said["clock change"] = f"the end of summer time: from sample {at + 2} on an hour is added"
    return t + HOUR_S * (np.arange(len(t)) > at)


def _first_of_repeated(t: Array, values: Sequence[Array], rows: Rows) -> npt.NDArray[np.bool_]:
    """Return which rows are the first of those that are the same in time and all values."""
    table = np.column_stack([t, *(column[rows] for column in values)])
    order = np.lexsort(table.T[::-1])
    ordered = table[order]
    same = ((ordered[1:] == ordered[:-1]) | (np.isnan(ordered[1:]) & np.isnan(ordered[:-1]))).all(axis=1)
    once = np.ones(len(t), dtype=np.bool_)
    once[order[1:][same]] = False
    return once


def _sort_rows(t: Array, rows: Rows, said: dict[str, str]) -> tuple[Array, Rows]:
    """Return the rows sorted by time, if they fall into place then; else as they are."""
    steps = np.diff(t)
    if not (steps < 0).any():
        return t, rows
    order = np.argsort(t, kind="stable")
    if _fall_into_place(steps, np.diff(t[order])):
        displaced = int((steps < 0).sum())
        said["order"] = f"{said.get('order', '')}, {displaced} times out of order; sorted".lstrip(", ")
        return t[order], rows[order]
    return t, rows


def _fall_into_place(steps: Array, sorted_steps: Array) -> bool:
    """Return whether sorted rows lie as rows in order do; where hardly any are in order, whether they lie evenly."""
    if not (steps > 0).any():
        return False
    least = float(sorted_steps.min())
    if (steps < 0).mean() > SHUFFLED:
        return least > 0.5 * float(np.median(sorted_steps))
    return least > 0.5 * float(np.quantile(steps[steps > 0], 0.05))


def _require_a_clock(path: Path, t: Array, rows: Rows, lines: Sequence[int]) -> None:
    steps = np.diff(t)
    equal = np.flatnonzero(steps == 0)
    if equal.size:
        first, second = (lines[int(rows[int(equal[0]) + each])] for each in (0, 1))
        raise InputError(
            str(path),
            f"lines {first} and {second} are of one time and have different values, "
            f"{equal.size} of {len(t)} rows are such: export fractions of seconds, one row a time, or "
            "leave out time_s and say how far rows lie apart, --period-s S",
        )
    back = np.flatnonzero(steps < 0)
    if back.size > SET_BACK_TOLERATED * len(t):
        line = lines[int(rows[int(back[0]) + 1])]
        raise InputError(
            str(path),
            f"time goes back {back.size} times in {len(t)} rows, at line {line} first, and the rows do not fall into "
            "place when sorted: export one stretch of one clock at a time",
        )

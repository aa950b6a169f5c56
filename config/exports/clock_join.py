"""Columns of different clocks laid on one: the stem's own.

    command, set point, state     held: what is in force at t is the last that was said at or before t
    what is measured              on straight lines between its samples, and nowhere beyond them

What is asked of the stem before the first sample of it, and for long after its last, nobody knows: the stem's samples
there are left out, and counted.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from config.errors import InputError
from config.recording import Column

MEASURED = ("position", "velocity", "pressure", "load", "current", "force", "torque")
"""How the names of columns begin that are measured."""
SAME = 1e-3
"""Of a clock's step: times that are closer are one, for two programs round them differently."""


@dataclass(frozen=True, slots=True)
class Group:
    """Columns of one clock.

    Attributes:
        time_s: (n,), increasing.
        origin_s: zero of this clock, s since 1970; None where it does not tell the day.
        columns: by our names.
        named: what its clock is called, for people.
    """

    time_s: Column
    origin_s: float | None
    columns: dict[str, Column]
    named: str


def joined(path: Path, groups: Sequence[Group]) -> tuple[Column, dict[str, Column], dict[str, str]]:
    """Return the time of the stem's samples, s, from its clock's zero, the columns at it, and what was done.

    Raises:
        InputError: no time is common to all, or one clock tells the day and another does not.
    """
    base = next(each for each in groups if any(name.startswith(("position", "velocity")) for name in each.columns))
    others = [each for each in groups if each is not base]
    if len({each.origin_s is None for each in groups}) > 1:
        told = next(each.named for each in groups if each.origin_s is not None)
        not_told = next(each.named for each in groups if each.origin_s is None)
        raise InputError(
            str(path),
            f"{told!r} tells the day and {not_told!r} does not, so that their rows cannot be laid side by side: export "
            "both with one clock",
        )
    time_s = base.time_s
    within = np.ones(time_s.size, dtype=np.bool_)
    columns = dict(base.columns)
    said = []
    for each in others:
        own_s = each.time_s + ((each.origin_s or 0.0) - (base.origin_s or 0.0))
        for name, values in each.columns.items():
            columns[name], known = _at(time_s, own_s, values, held=not name.startswith(MEASURED))
            within &= known
            how = "held" if not name.startswith(MEASURED) else "interpolated"
            said.append(f"{name} from {own_s.size} samples of {each.named!r}, {how}")
    if not within.any():
        raise InputError(
            str(path),
            f"no time is common to its columns: {base.named!r} goes from {time_s[0]:.6g} to {time_s[-1]:.6g} s, "
            f"{others[0].named!r} ends {_ends(base, others)} s after the beginning of that",
        )
    notes = {"clocks": f"each column by its own: {'; '.join(said)}; the stem's own clock, {base.named!r}, is kept"}
    if left := int((~within).sum()):
        notes["rows at times of which the other columns say nothing, left out"] = str(left)
    return time_s[within], {name: column[within] for name, column in columns.items()}, notes


def _ends(base: Group, others: Sequence[Group]) -> str:
    other = others[0]
    return f"{other.time_s[-1] + (other.origin_s or 0.0) - (base.origin_s or 0.0) - base.time_s[0]:.6g}"


def _at(time_s: Column, own_s: Column, values: Column, *, held: bool) -> tuple[Column, "np.typing.NDArray[np.bool_]"]:
    """Return a column at other times, and at which of these it is known.

    What is held is known from its first sample to the longest of its steps after its last.
    """
    steps = np.diff(own_s)
    steps = steps[steps > 0.0] if (steps > 0.0).any() else np.zeros(1)
    before = np.searchsorted(own_s, time_s + SAME * float(np.median(steps)), side="right") - 1
    longest_s = float(steps.max())
    if held:
        return values[np.maximum(before, 0)], (before >= 0) & (time_s < own_s[-1] + longest_s)
    known = np.isfinite(values)
    inside = (time_s >= own_s[0]) & (time_s <= own_s[-1])
    if not known.any():
        return np.full(time_s.size, np.nan), np.ones(time_s.size, dtype=np.bool_)
    at = np.interp(time_s, own_s[known], values[known])
    return np.where(inside, at, np.nan), np.ones(time_s.size, dtype=np.bool_)

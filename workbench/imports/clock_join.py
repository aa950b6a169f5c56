"""Columns of different clocks laid on one: the stem's own.

    command, set point, state     held: what is in force at t is the last that was said at or before t
    what is measured              on straight lines between its samples, and nowhere beyond them

A command that changes seldom keeps the instants of its changes: each is a row of its own, at which the stem was not
measured.

Two clocks of one table whose rows step alike tell the same instants where they are of other kinds, units or zones: a
stamp and what has elapsed, s and ms, local time and UTC. Their rows are pairs.

What is asked of the stem before the first sample of it, and for long after its last, nobody knows: the stem's samples
there are left out, and counted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from config.errors import InputError
from config.recording import Column
from workbench.imports.cell_units import UNITS

MEASURED = ("position", "velocity", "pressure", "load", "current", "force", "torque")
"""How the names of columns begin that are measured."""
FEWEST_CLOCK_ROWS = 3  # two rows make no step to compare
ALIKE_STEP = 1e-2
"""Of a step: how alike those of two clocks of the same rows are, each rounded by its program."""
RATIOS = tuple(each for unit in UNITS["_s"].values() if unit != 1.0 for each in (unit, 1.0 / unit))
"""Of two clocks that count in different units."""
ZONE_S = 900.0
"""Zones of time lie apart by quarters of an hour."""
CHANGES_PER_SAMPLE = 0.5
"""Changes of a command a sample of the stem, up to which each keeps its instant."""
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
        table: which table of the file it is from.
    """

    time_s: Column
    origin_s: float | None
    columns: dict[str, Column]
    named: str
    table: int = 0


def align(path: Path, groups: Sequence[Group]) -> tuple[Column, dict[str, Column], dict[str, str]]:
    """Return the time of the stem's samples, s, from its clock's zero, the columns at it, and what was done.

    Raises:
        InputError: no time is common to all, or one clock tells the day and another does not.
    """
    base = next(each for each in groups if any(name.startswith(("position", "velocity")) for name in each.columns))
    others = [_pair_group(each, base) for each in groups if each is not base]
    if len({each.origin_s is None for each in (base, *others)}) > 1:
        told = next(each.named for each in groups if each.origin_s is not None)
        not_told = next(each.named for each in groups if each.origin_s is None)
        raise InputError(
            str(path),
            f"{told!r} tells the day and {not_told!r} does not, so that their rows cannot be laid side by side: export "
            "both with one clock",
        )
    others_s = [each.time_s + ((each.origin_s or 0.0) - (base.origin_s or 0.0)) for each in others]
    time_s, measured = _with_changes(base.time_s, others, others_s)
    within = np.ones(time_s.size, dtype=np.bool_)
    columns = {name: np.full(time_s.size, np.nan) for name in base.columns}
    for name, column in base.columns.items():
        columns[name][measured] = column
    said = []
    for each, own_s in zip(others, others_s, strict=True):
        for name, values in each.columns.items():
            held = _is_held(name)
            columns[name], known = _at(time_s, own_s, values, held=held)
            within &= known
            how = "held" if held else "interpolated"
            said.append(f"{name} from {own_s.size} samples of {each.named!r}, {how}")
    if not within.any():
        raise InputError(
            str(path),
            f"no time is common to its columns: {base.named!r} goes from {time_s[0]:.6g} to {time_s[-1]:.6g} s, "
            f"{others[0].named!r} from {others_s[0][0]:.6g} to {others_s[0][-1]:.6g} s",
        )
    alike = all(own_s.size == base.time_s.size and np.allclose(own_s, base.time_s) for own_s in others_s)
    own = f"each column by its own: {'; '.join(said)}; the stem's own clock, {base.named!r}, is kept"
    notes = {} if alike else {"clocks": own}
    if left := int((~within).sum()):
        notes["rows at times of which the other columns say nothing, left out"] = str(left)
    if added := int((~measured & within).sum()):
        notes["rows at which a command changes between samples of the stem"] = str(added)
    return time_s[within], {name: column[within] for name, column in columns.items()}, notes


def _pair_group(group: Group, base: Group) -> Group:
    """Return a group by the stem's clock where its own tells the same instants in other words."""
    own_s, stem_s = group.time_s, base.time_s
    if group.table != base.table or own_s.size != stem_s.size or own_s.size < FEWEST_CLOCK_ROWS:
        return group
    ratio = float(np.ptp(own_s) / np.ptp(stem_s)) if np.ptp(stem_s) > 0.0 else 0.0
    if ratio <= 0.0 or not np.allclose(
        np.diff(own_s), ratio * np.diff(stem_s), rtol=0.0, atol=ALIKE_STEP * _step_s(own_s)
    ):
        return group
    told_otherwise = any(abs(ratio / each - 1.0) < ALIKE_STEP for each in RATIOS)
    if abs(ratio - 1.0) < ALIKE_STEP:
        if group.origin_s is None or base.origin_s is None:
            told_otherwise = (group.origin_s is None) != (base.origin_s is None)
        else:
            late_s = own_s[0] - stem_s[0] + group.origin_s - base.origin_s
            told_otherwise = round(late_s / ZONE_S) != 0 and abs(late_s - ZONE_S * round(late_s / ZONE_S)) < 1.0
    return replace(group, time_s=stem_s, origin_s=base.origin_s) if told_otherwise else group


def _is_held(name: str) -> bool:
    return not name.startswith(MEASURED)


def _with_changes(
    base_s: Column, others: Sequence[Group], others_s: Sequence[Column]
) -> tuple[Column, "np.typing.NDArray[np.bool_]"]:
    """Return the stem's times and the instants between them at which what is held changes, and which are the stem's.

    Of a command that changes more often than every other sample no instants are added.
    """
    near_s = SAME * _step_s(base_s)
    added = []
    for each, own_s in zip(others, others_s, strict=True):
        for values in (column for name, column in each.columns.items() if _is_held(name)):
            known = np.isfinite(values)
            at_s = own_s[known][1:][np.diff(values[known]) != 0.0]
            following = np.minimum(np.searchsorted(base_s, at_s), base_s.size - 1)
            apart = np.minimum(np.abs(base_s[following] - at_s), np.abs(base_s[np.maximum(following - 1, 0)] - at_s))
            between = at_s[(apart > near_s) & (at_s > base_s[0]) & (at_s < base_s[-1])]
            added += [between] if between.size <= CHANGES_PER_SAMPLE * base_s.size else []
    instants = np.unique(np.concatenate(added)) if added else np.empty(0)
    time_s = np.concatenate([base_s, instants])
    order = np.argsort(time_s, kind="stable")
    return time_s[order], (np.arange(time_s.size) < base_s.size)[order]


def _step_s(time_s: Column) -> float:
    steps = np.diff(time_s)
    return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0


def _at(time_s: Column, own_s: Column, values: Column, *, held: bool) -> tuple[Column, "np.typing.NDArray[np.bool_]"]:
    """Return a column at other times, and at which of these it is known.

    What is held is known from its first sample to the longest of its steps after its last.
    """
    before = np.searchsorted(own_s, time_s + SAME * _step_s(own_s), side="right") - 1
    longest_s = float(np.diff(own_s).max()) if own_s.size > 1 else 0.0
    if held:
        return values[np.maximum(before, 0)], (before >= 0) & (time_s < own_s[-1] + longest_s)
    known = np.isfinite(values)
    inside = (time_s >= own_s[0]) & (time_s <= own_s[-1])
    if not known.any():
        return np.full(time_s.size, np.nan), np.ones(time_s.size, dtype=np.bool_)
    at = np.interp(time_s, own_s[known], values[known])
    return np.where(inside, at, np.nan), np.ones(time_s.size, dtype=np.bool_)

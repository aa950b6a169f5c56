"""A control loop's export read: time, OP, PV, SP and mode, in whatever units the plant has, NaN where there is none.

The columns are those that `control_loop` recognises, unless a person names them. OP must be in %: another range
(counts, mA) is said by a person and never guessed.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from config.errors import InputError
from workbench.imports.cell_kinds import may_be_clock, numbers_of
from workbench.imports.cell_units import SHARES, UNITS, with_any_unit
from workbench.imports.clock_groups import find_groups
from workbench.imports.column_clock import clock_of
from workbench.imports.column_proposal import is_clock
from workbench.imports.control_loop import LEAST_OUT, MOST_OUT, LoopColumns, loop_by_names, stem_by_name
from workbench.imports.export_preview import ExportPreview, preview
from workbench.imports.file_kind import raw_tables
from workbench.imports.number_notation import decimal_sign
from workbench.imports.raw_table import Cell
from workbench.imports.sample_rows import Samples, collect_samples
from workbench.imports.time_order import in_order

Array = npt.NDArray[np.float64]
MODE = re.compile(r"mode|betriebsart|auto", re.IGNORECASE)
MANUAL = re.compile(r"^(m|man|manual|hand|0|off|iman|track\w*)$", re.IGNORECASE)
"""Modes in which the controller is not in charge."""
TIME = re.compile(r"time|zeit|stamp|date|datum|^ts?\b", re.IGNORECASE)
ROLES = ("time", "op", "pv", "sp", "mode")


@dataclass(frozen=True, slots=True)
class LoopSamples:
    """A loop's samples as they were read, (n,) each.

    Attributes:
        name: the loop's tag, or the file's name.
        begin_s: of the first sample, s since 1970, or by the file's own clock.
        time_s: from there.
        op_pct, pv, sp: as recorded; sp None where there is none.
        automatic: where the mode is none of manual; None where no mode is on record.
        notes: what was put right.
    """

    name: str
    begin_s: float
    time_s: Array
    op_pct: Array
    pv: Array
    sp: Array | None
    automatic: npt.NDArray[np.bool_] | None
    notes: Mapping[str, str] = field(default_factory=dict)


def read_loop(
    path: Path,
    named: Mapping[str, str] | None = None,
    op_range: tuple[float, float] | None = None,
    time_format: str | None = None,
    decimal: str | None = None,
) -> LoopSamples:
    """Read a loop.

    Args:
        path: any export.
        named: columns by role, of `ROLES`, that a person names.
        op_range: what the file has for 0 % and 100 % of the output; None: as its unit says, else 0 and 100.
        time_format: how dates are written.
        decimal: the decimal sign; None: as the numbers show.

    Raises:
        InputError: the file cannot be read, no loop or several are recognised, or OP is no share; says what to type.
    """
    roles = dict(named or {})
    loop = None if {"time", "op", "pv"} <= set(roles) else _recognise(path, roles)
    roles["time"], unit = _and_unit(roles["time"])
    wanted = [theirs for role, theirs in roles.items() if role != "time"]
    headers = find_groups(path, raw_tables(path), roles["time"], wanted)
    parts = [collect_samples(path, header, roles["time"], lambda _what, _done: None) for header in headers]
    texts = [
        cell
        for part in parts
        for role in ("op", "pv")
        for cell in part.cells.get(roles[role], ())
        if isinstance(cell, str)
    ]
    decimal = decimal or decimal_sign(str(path), texts, headers[0].table.separator)
    read = [_of_one_clock(path, part, roles, unit, time_format, decimal) for part in parts]
    time_s, columns = _lay_on_pv(path, read)
    notes = {
        key: said for part, each in zip(parts, read, strict=True) for key, said in (part.notes | each.notes).items()
    }
    op_pct = _percent(path, roles["op"], columns["op"], op_range or _range_in(parts, roles["op"]), notes)
    name = loop.tag if loop is not None and loop.tag else path.stem
    return LoopSamples(
        name,
        float(time_s[0]),
        time_s - time_s[0],
        op_pct,
        columns["pv"],
        columns.get("sp"),
        columns["mode"] == 0.0 if "mode" in columns else None,
        notes,
    )


def _range_in(parts: Sequence[Samples], output: str) -> tuple[float, float] | None:
    """Return the numbers for 0 % and 100 % by the output's unit, above its column or behind its first number."""
    units = [
        unit
        for part in parts
        if (cells := part.cells.get(output))
        for unit in (part.header.units.get(output, ("", 0))[0], with_any_unit(str(cells[0]))[1])
    ]
    factor, offset = next((SHARES[unit] for unit in units if unit in SHARES), (0.0, 0.0))
    return (-offset / factor, (1.0 - offset) / factor) if factor else None


def _percent(
    path: Path, output: str, values: Array, op_range: tuple[float, float] | None, notes: dict[str, str]
) -> Array:
    """Return the output in %; where nobody says what it is in, numbers that may be mA get a note.

    Raises:
        InputError: it is no share in %, or may be one of 1.
    """
    low, high = op_range or (0.0, 100.0)
    op_pct = 100.0 * (values - low) / (high - low)
    known = op_pct[np.isfinite(op_pct)]
    if not known.size:
        return op_pct
    least, most = float(known.min()), float(known.max())
    goes = f"output {output!r} goes from {least:g} to {most:g}"
    if least < LEAST_OUT or most > MOST_OUT:
        raise InputError(str(path), f"{goes}: no share in %; say what it has at 0 % and 100 %, as --op-range 0 27648")
    if op_range is None and most <= 1.0:
        raise InputError(str(path), f"{goes}: a share of 1, or in %? Say --op-range 0 1, or --op-range 0 100")
    if op_range is None and least >= LEAST_MA and most <= MOST_MA:
        notes["unit of the output"] = f"{least:g} to {most:g} are taken for %; if they are mA, say --op-range 4 20"
    return op_pct


LEAST_MA, MOST_MA = 3.6, 21.0
"""Signals of 4 to 20 mA that are no fault (NAMUR NE 43)."""


@dataclass(frozen=True, slots=True)
class _OneClock:
    """Columns of one clock, by role, (n,) each, in the order of its time, s; `mode` is 1 in manual."""

    time_s: Array
    columns: dict[str, Array]
    notes: dict[str, str]


def _of_one_clock(
    path: Path, part: Samples, roles: Mapping[str, str], unit: str | None, time_format: str | None, decimal: str
) -> _OneClock:
    clock = clock_of(path, part, roles["time"], unit, time_format, decimal, "--time ")
    values: dict[str, Array] = {}
    for role, theirs in roles.items():
        if role == "mode" and theirs in part.cells:
            values[role] = np.array([float(MANUAL.match(str(each).strip()) is not None) for each in part.cells[theirs]])
        elif role != "time" and theirs in part.cells:
            _require_one_unit(path, theirs, part.cells[theirs])
            values[role] = numbers_of(part.cells[theirs], decimal)
    time_s, columns, notes = in_order(path, clock, values, part.lines)
    return _OneClock(time_s + (clock.origin_s or 0.0), columns, notes)


def _and_unit(theirs: str) -> tuple[str, str | None]:
    """Return a clock's column and the unit that a person said behind it: `Time:ms`."""
    name, _, unit = theirs.rpartition(":")
    return (name, unit) if name and unit in UNITS["_s"] else (theirs, None)


def _require_one_unit(path: Path, theirs: str, cells: Sequence[Cell]) -> None:
    """See that one unit stands behind a column's numbers, or none.

    Raises:
        InputError: it changes, as a display's does that scales by itself.
    """
    units = list(dict.fromkeys(unit for cell in cells if isinstance(cell, str) and (unit := with_any_unit(cell)[1])))
    if len(units) > 1:
        raise InputError(str(path), f"{theirs!r} is in {' and in '.join(units)}: export it with one unit, unformatted")


def _lay_on_pv(path: Path, parts: Sequence[_OneClock]) -> tuple[Array, dict[str, Array]]:
    """Return PV's time and all columns at it: OP on straight lines between its samples, SP and mode as last said.

    Raises:
        InputError: OP has no time in common with PV.
    """
    base = next(each for each in parts if "pv" in each.columns)
    columns = dict(base.columns)
    for part in (each for each in parts if each is not base):
        for role, values in part.columns.items():
            if role == "op":
                columns[role] = np.interp(base.time_s, part.time_s, values, np.nan, np.nan)
            else:
                columns[role] = values[np.maximum(np.searchsorted(part.time_s, base.time_s, "right") - 1, 0)]
    if not np.isfinite(columns["op"]).any():
        raise InputError(str(path), "output and process value have no time in common: export both of one period")
    return base.time_s, columns


def _recognise(path: Path, roles: dict[str, str]) -> LoopColumns | None:
    """Fill in the roles that nobody named; return the loop they are of.

    Raises:
        InputError: none is recognised, or several are.
    """
    found = preview(path)
    names = ", ".join(each.name for each in found.columns)
    say = f"say --time NAME --op NAME --pv NAME (--sp, --mode); there are: {names}"
    loops = [each for each in found.loops if _is_of(each, roles)]
    if len(loops) > 1:
        which = ", ".join(f"{each.output!r} of {each.tag}" for each in loops)
        raise InputError(str(path), f"holds {len(loops)} loops; say which by --op NAME, its output: {which}")
    loop = loops[0] if loops else None
    columns = [each.name for each in found.columns]
    stem = stem_by_name(columns) if loop is None else loop.position
    if stem and not roles:
        raise InputError(
            str(path), f"{stem!r} is a stem's position: `positioner diagnose` reads it; for the loop alone {say}"
        )
    if loop is None and not {"op", "pv"} <= set(roles):
        if called := loop_by_names(columns):
            op, pv = called
            raise InputError(
                str(path),
                f"{op!r} is called an output and is no share in %: say what it has at 0 % and 100 %, as "
                f"--op {op} --pv {pv} --op-range 0 27648",
            )
        raise InputError(str(path), f"no loop is recognised by names and ranges: {say}")
    known = _mode_and_time(found)
    if loop is not None:
        known |= {"op": loop.output, "pv": loop.process_value} | ({"sp": loop.setpoint} if loop.setpoint else {})
    for role, theirs in known.items():
        roles.setdefault(role, theirs)
    if "time" not in roles:
        raise InputError(str(path), f"no column looks like a time: {say}")
    return loop


def _is_of(loop: LoopColumns, named: Mapping[str, str]) -> bool:
    """Return whether a loop has the columns that a person named."""
    theirs = {"op": loop.output, "pv": loop.process_value, "sp": loop.setpoint}
    return all(role not in theirs or theirs[role] == name for role, name in named.items())


def _mode_and_time(found: ExportPreview) -> dict[str, str]:
    """Return the clock, told by its cells, or else by its name, and the mode."""
    clocks = [each.name for each in found.columns if is_clock(each)]
    clocks += [each.name for each in found.columns if TIME.search(each.name) or may_be_clock(each.cells)]
    modes = [each.name for each in found.columns if MODE.search(each.name)]
    return {role: names[0] for role, names in (("time", clocks), ("mode", modes)) if names}

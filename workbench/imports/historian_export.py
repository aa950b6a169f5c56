"""An export of another program as a recording: columns by their own names and units, made SI.

A mapping says which column is which, `position_m=PV:%`: our name, theirs, their unit. Everything else the file says
itself: its encoding, separators, where the names stand, units beside them, the decimal sign, the order of rows, which
clock each column goes by. Where it leaves something open, or contradicts the mapping, one line says what to type. Words
in place of numbers (`Bad`, `No Data`) become NaN. What was found, left out, put right or assumed is told in the
metadata. `workbench.imports` does each step.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from config.errors import InputError
from config.recording import REQUIRED, Column, Recording
from workbench.imports.cell_units import SHARES, UNITS
from workbench.imports.clock_groups import find_groups
from workbench.imports.clock_join import Group, align
from workbench.imports.column_clock import clock_by_rows, clock_of
from workbench.imports.column_mapping import RANGE_PA, ExportOptions, Source
from workbench.imports.file_kind import raw_tables
from workbench.imports.number_notation import decimal_sign
from workbench.imports.raw_table import Cell
from workbench.imports.sample_rows import Progress, Samples, collect_samples
from workbench.imports.time_order import in_order
from workbench.imports.typed_columns import Scale, in_si, numerals, unit_of

PLAIN = ExportOptions()


def read_export(
    path: Path,
    sources: Sequence[Source],
    stroke_m: float | None,
    range_pa: tuple[float, float] | None = None,
    options: ExportOptions = PLAIN,
    progress: Progress | None = None,
) -> Recording:
    """Read an export.

    Args:
        path: the file.
        sources: the columns, see `read_mapping`.
        stroke_m: 100 % of a position; None where no column needs it.
        range_pa: 0 % and 100 % of a pressure; None: `RANGE_PA` is assumed where one is needed, and told.
        options: how it is read beyond that.
        progress: called with what is being done, and the fraction of it done.

    Raises:
        InputError: the file cannot be read, holds more than `MOST_ROWS` rows, lacks a column, holds no sample or no
            readable time, contradicts the mapping or leaves open how it is to be read; says what to type.
        ModuleNotFoundError: a workbook, MATLAB or Parquet file without the package that reads it; names the extra.
    """
    tell = progress or (lambda _what, _done: None)
    clock = next((each for each in sources if each.name == "time_s"), None)
    values = [each for each in sources if each is not clock]
    headers = find_groups(
        path,
        raw_tables(path, options.sheet),
        clock.theirs if clock else None,
        [each.theirs for each in values],
        [each.theirs for each in options.status],
    )
    parts = [collect_samples(path, header, clock.theirs if clock else None, tell) for header in headers]
    read = [[each for each in sources if each.theirs in part.cells] for part in parts]
    shown = [text for part, of_it in zip(parts, read, strict=True) for text in numerals(part, of_it)]
    decimal = options.decimal or decimal_sign(str(path), shown, headers[0].table.separator)
    scale: Scale = (stroke_m, range_pa or RANGE_PA)
    metadata: dict[str, str] = {}
    groups: list[Group] = []
    units: dict[str, str] = {}
    for part, of_it in zip(parts, read, strict=True):
        metadata |= part.header.table.notes
        units |= {each.name: unit_of(path, each, part) for each in of_it}
        groups.append(_group(path, part, of_it, units, decimal, scale, options, tell, metadata))
    said = ", ".join(f"{each.name} from {each.theirs} in {units.get(each.name, 's')}" for each in sources)
    metadata = {"imported": said} | _list_assumptions(units, range_pa) | metadata
    (time_s, columns, notes) = (groups[0].time_s, groups[0].columns, {}) if len(groups) == 1 else align(path, groups)
    named = {"time_s": time_s} | columns
    return Recording.of({name: named[name] for name in sorted(named, key=_contract_order)}, metadata | notes)


def _list_assumptions(units: dict[str, str], range_pa: tuple[float, float] | None) -> dict[str, str]:
    """Return what had to be assumed of the pressures that shares are of, and how to say others."""
    shares = [
        f"{name} in {unit}"
        for name, unit in units.items()
        if name.endswith("_pa") and unit.removeprefix("-") in SHARES and unit not in UNITS["_pa"]
    ]
    if not shares:
        return {}
    low, high = range_pa or RANGE_PA
    ends = f"{', '.join(shares)}: 0 % is {low * 1e-5:g} bar, 100 % {high * 1e-5:g} bar"
    if range_pa is not None:
        return {"range": ends}
    return {"assumed": f"{ends}, for nobody has said it; --range-pa {low:g} {high:g} says so, other numbers other ends"}


def _contract_order(name: str) -> tuple[int, str]:
    return (REQUIRED.index(name), "") if name in REQUIRED else (len(REQUIRED), name)


def _group(
    path: Path,
    part: Samples,
    sources: Sequence[Source],
    units: dict[str, str],
    decimal: str,
    scale: Scale,
    options: ExportOptions,
    tell: Progress,
    metadata: dict[str, str],
) -> Group:
    """Return the columns of one clock in SI and in the order of their time; what was done goes into the metadata."""
    theirs = next((each for each in sources if each.name == "time_s"), None)
    values = [each for each in sources if each is not theirs]
    if theirs is None:
        period_s = options.period_s or 1.0
        clock = clock_by_rows(len(part.lines), period_s)
        metadata["time_s"] = f"by the number of the row, rows {period_s:g} s apart"
    else:
        clock = clock_of(path, part, theirs.theirs, theirs.unit, options.time_format, decimal)
    good = _good(path, part, options, metadata)
    columns: dict[str, Column] = {}
    for count, source in enumerate(values):
        tell(f"understanding {len(part.lines)} rows", (count + 1) / (len(values) + 1))
        columns[source.name] = np.where(good, in_si(path, part, source, units[source.name], decimal, scale), np.nan)
    time_s, ordered, said = in_order(path, clock, columns, part.lines)
    metadata |= part.notes | said
    zero_s = 0.0 if clock.origin_s is None else time_s[0]
    if clock.recorded and "recorded" not in metadata:
        metadata["recorded"] = clock.recorded
    name = "" if theirs is None else part.header.names[part.header.at[theirs.theirs][0]]
    origin_s = None if clock.origin_s is None else clock.origin_s + time_s[0] - clock.time_s[0]
    return Group(time_s - zero_s, origin_s, ordered, name, id(part.header.table))


def _good(path: Path, part: Samples, options: ExportOptions, metadata: dict[str, str]) -> "np.typing.NDArray[np.bool_]":
    """Return which rows every status column calls good."""
    good = np.ones(len(part.lines), dtype=np.bool_)
    for status in options.status:
        if status.theirs not in part.cells:
            continue
        words = [_word(cell) for cell in part.cells[status.theirs]]
        here = np.array([word in status.good for word in words])
        if not here.any():
            holds = ", ".join(f"{word or 'nothing'} ({count})" for word, count in Counter(words).most_common(5))
            raise InputError(
                str(path),
                f"no row's {status.theirs!r} is {' or '.join(status.good)}; it holds: {holds}; say which are good",
            )
        metadata[f"rows that are not {'/'.join(status.good)} in {status.theirs}, read without values"] = str(
            int((~here).sum())
        )
        good &= here
    return good


def _word(cell: Cell) -> str:
    return f"{cell:.17g}" if isinstance(cell, float) else cell

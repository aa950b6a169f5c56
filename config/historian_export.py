"""An export of another program as a recording: columns by their own names and units, made SI.

A mapping says which column is which, `position_m=PV:%`: our name, theirs, their unit. Everything else the file says
itself: its encoding, separators, where the names stand, units beside them, the decimal sign, the order of rows. Where
it leaves something open, or contradicts the mapping, one line says what to type. Words in place of numbers (`Bad`,
`No Data`) become NaN. What was found, left out or put right is told in the metadata. `config.exports` does each step.
"""

import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import isnan
from pathlib import Path

import numpy as np

from config.errors import InputError
from config.exports.column_mapping import RANGE_PA, ExportOptions, Source
from config.exports.export_units import (
    ABSOLUTE,
    ATMOSPHERE_PA,
    SHARES,
    SI,
    UNITS,
    allowed_units,
    ending_of,
    unit_named,
)
from config.exports.file_kind import raw_tables
from config.exports.header_search import Header, begins_number, find_header
from config.exports.number_notation import decimal_sign, is_numeral, number
from config.exports.raw_table import Cell
from config.exports.time_order import in_order
from config.exports.time_stamps import clock_unit, has_date, seconds_of
from config.recording import REQUIRED, Column, Recording

PLAIN = ExportOptions()
Progress = Callable[[str, float], None]
MOST_ROWS = 3_000_000
"""Of an export: a minute of reading, and some hundred bytes of memory a cell."""
TOLD_EVERY = 50_000
"""Rows."""
FOOTER = 20
"""Rows without a time that may end a file: averages, signatures."""
_WITH_UNIT = re.compile(r"([+\u2212-]?[\d.,]+(?:[eE][+-]?\d+)?)\s*([^\d\s].*)")


def read_export(
    path: Path,
    sources: Sequence[Source],
    stroke_m: float | None,
    range_pa: tuple[float, float] = RANGE_PA,
    options: ExportOptions = PLAIN,
    progress: Progress | None = None,
) -> Recording:
    """Read an export.

    Args:
        path: the file.
        sources: the columns, see `read_mapping`.
        stroke_m: 100 % of a position; None where no column needs it.
        range_pa: 0 % and 100 % of a pressure.
        options: how it is read beyond that.
        progress: called with what is being done, and the fraction of it done.

    Raises:
        InputError: the file cannot be read, holds more than `MOST_ROWS` rows, lacks a column, holds no sample or no
            readable time, contradicts the mapping or leaves open how it is to be read; says what to type.
        ModuleNotFoundError: a workbook, MATLAB or Parquet file without the package that reads it; names the extra.
    """
    wanted = [*(each.theirs for each in sources), *(each.theirs for each in options.status)]
    header = find_header(path, raw_tables(path, options.sheet), list(dict.fromkeys(wanted)))
    tell = progress or (lambda _what, _done: None)
    export = _collected(path, header, tell)
    decimal = options.decimal or decimal_sign(str(path), _numerals(export, sources), header.table.separator)
    metadata = dict(header.table.notes)
    units = {each.name: _unit(path, each, export) for each in sources}
    metadata["imported"] = ", ".join(f"{each.name} from {each.theirs} in {units[each.name]}" for each in sources)
    (clock,) = (each for each in sources if each.name == "time_s")
    time_s, stamped, local_from_s = _time(path, export, clock, units["time_s"], decimal, options)
    good = _good(path, export, options, metadata)
    values: dict[str, Column] = {}
    for count, source in enumerate(each for each in sources if each.name != "time_s"):
        tell(f"understanding {len(export.lines)} rows", (count + 1) / (len(sources) + 1))
        raw = _numbers(path, export, source, decimal, metadata)
        si = _in_si(raw, source, units[source.name], stroke_m, range_pa)
        values[source.name] = np.where(good, si, np.nan)
    daily = local_from_s is not None and not has_date(options.time_format)
    time_s, rows, said = in_order(
        path, time_s, list(values.values()), export.lines, local_from_s=local_from_s, daily=daily
    )
    columns = {"time_s": time_s - time_s[0] if stamped else time_s} | {
        name: column[rows] for name, column in values.items()
    }
    return Recording.of(
        {name: columns[name] for name in sorted(columns, key=_contract_order)}, metadata | export.notes | said
    )


def _contract_order(name: str) -> tuple[int, str]:
    return (REQUIRED.index(name), "") if name in REQUIRED else (len(REQUIRED), name)


@dataclass(frozen=True, slots=True)
class _Export:
    """The columns that are wanted, as cells, by their names; where each row stands, and what was left out."""

    header: Header
    cells: dict[str, list[Cell]]
    lines: "array[int]"
    notes: dict[str, str]


def _collected(path: Path, header: Header, tell: Progress) -> _Export:
    """Return the cells of the samples: no blank rows, no header again, no footer, no torn last row."""
    _require_few(path, header.table.length)
    cells: dict[str, list[Cell]] = {name: [] for name in header.at}
    lines = array("q")
    notes: Counter[str] = Counter()
    if header.samples_after > header.line > 0:
        notes["rows under the header that are no samples"] = header.samples_after - header.line
    short: list[int] = []
    for line, row in _samples(path, header, notes):
        if len(row) <= max(max(places) for places in header.at.values()):
            short.append(line)
        for name, places in header.at.items():
            cells[name].append(_joined(row, places))
        lines.append(line)
        if not len(lines) % TOLD_EVERY:
            _require_few(path, len(lines))
            tell(f"reading {path.name}: {len(lines)} rows", len(lines) / max(header.table.length, len(lines)))
    if short and not header.table.ended and short[-1] == lines[-1]:
        _drop_last(cells, lines)
        short.pop()
        notes["torn: the last row is not whole and was left out"] = 1
    if short:
        notes["rows that end early"] = len(short)
    if not lines:
        raise InputError(str(path), f"holds no samples under the names of {header.table.place} {header.line}")
    return _Export(header, cells, lines, {key: str(count) for key, count in notes.items()})


def _require_few(path: Path, rows: int) -> None:
    if rows > MOST_ROWS:
        raise InputError(
            str(path),
            f"has {rows / 1e6:.3g} million rows, and an export is read up to {MOST_ROWS / 1e6:g} million: export a "
            "shorter stretch, or split the file",
        )


def _samples(path: Path, header: Header, notes: Counter[str]) -> Iterator[tuple[int, list[Cell]]]:
    again = list(header.names)
    width = max(len(header.names), 1)
    for line, row in header.table.rows():
        if line <= header.samples_after or all(cell == "" for cell in row):
            continue
        if header.line and [str(cell) for cell in row] == again:
            notes["header lines again"] += 1
            continue
        if width > 1 and _is_remark(row, width):
            notes["rows of words alone, left out"] += 1
            continue
        if len(row) > width and any(cell != "" for cell in row[width:]):
            raise InputError(
                str(path),
                f"{header.table.place} {line}: {len(row)} fields, the header names {width}; do commas both separate "
                "and begin decimals? Then export it with semicolons or decimal points",
            )
        yield line, row


def _is_remark(row: Sequence[Cell], width: int) -> bool:
    """Return whether a row is words in its first field and nothing else, or a comment."""
    if row[0] == "" or begins_number(row[0]):
        return False
    return all(cell == "" for cell in row[1:]) or (str(row[0]).startswith("#") and len(row) < width)


def _drop_last(cells: dict[str, list[Cell]], lines: "array[int]") -> None:
    for column in cells.values():
        column.pop()
    lines.pop()


def _joined(row: Sequence[Cell], places: Sequence[int]) -> Cell:
    found = [row[place] if place < len(row) else "" for place in places]
    return found[0] if len(found) == 1 else " ".join(map(_midnight_cut, found)).strip()


def _midnight_cut(cell: Cell) -> str:
    """Return a cell's words; a date of a workbook without its midnight."""
    return str(cell).removesuffix("T00:00:00")


def _numerals(export: _Export, sources: Sequence[Source]) -> Iterator[str]:
    for source in sources:
        for cell in export.cells[source.theirs]:
            if isinstance(cell, str):
                text = cell
                if not is_numeral(text):
                    match = _WITH_UNIT.fullmatch(text) if unit_named(text.lstrip("+-0123456789.,eE ")) else None
                    text = match[1] if match else ""
                yield text


def _unit(path: Path, source: Source, export: _Export) -> str:
    """Return the unit of a column: as mapped, else as the file says, else SI.

    Raises:
        InputError: the file says another one than the mapping.
    """
    ending = ending_of(source.name)
    said = export.header.units.get(source.theirs) or _behind_numbers(export, source)
    if said is not None:
        unit, line = said
        mapped = (source.unit or "").removeprefix("-")
        place = f"{export.header.table.place} {line}"
        if unit not in allowed_units(ending):
            raise InputError(
                str(path),
                f"column {source.theirs!r} is in {unit} by {place}, and {source.name} takes "
                f"{', '.join(allowed_units(ending))}: is it another column?",
            )
        if mapped and mapped != unit and not (mapped in ABSOLUTE and mapped[:-1] == unit) and mapped != "iso":
            raise InputError(
                str(path),
                f"column {source.theirs!r} is in {unit} by {place}, the mapping says {mapped}: "
                f"type --column {source.name}={source.theirs}:{unit}, or mend the file",
            )
        return source.unit or unit
    if unknown := export.header.unknown.get(source.theirs):
        if source.unit is None and ending != "_s":
            raise InputError(
                str(path),
                f"column {source.theirs!r} has {unknown!r} where its unit stands, which is none that is known: "
                f"type --column {source.name}={source.theirs}:UNIT, of {', '.join(allowed_units(ending))}",
            )
        export.notes[f"unit of {source.theirs}, not known"] = unknown
    return source.unit or SI[ending]


def _behind_numbers(export: _Export, source: Source) -> tuple[str, int] | None:
    """Return the unit that stands behind the first number of a column, and where."""
    for cell, line in zip(export.cells[source.theirs], export.lines, strict=True):
        if isinstance(cell, str) and cell and begins_number(cell):
            match = _WITH_UNIT.fullmatch(cell)
            unit = unit_named(match[2]) if match else None
            return (unit, line) if unit else None
    return None


def _good(
    path: Path, export: _Export, options: ExportOptions, metadata: dict[str, str]
) -> "np.typing.NDArray[np.bool_]":
    """Return which rows every status column calls good."""
    good = np.ones(len(export.lines), dtype=np.bool_)
    for status in options.status:
        words = [_word(cell) for cell in export.cells[status.theirs]]
        here = np.array([word in status.good for word in words])
        if not here.any():
            holds = ", ".join(f"{word or 'nothing'} ({count})" for word, count in Counter(words).most_common(5))
            raise InputError(
                str(path),
                f"no row's {status.theirs!r} is {' or '.join(status.good)}; it holds: {holds}; say which are good",
            )
        metadata[f"rows not {'/'.join(status.good)} in {status.theirs}, without values"] = str(int((~here).sum()))
        good &= here
    return good


def _word(cell: Cell) -> str:
    return f"{cell:.17g}" if isinstance(cell, float) else cell


def _numbers(path: Path, export: _Export, source: Source, decimal: str, metadata: dict[str, str]) -> Column:
    """Return a column's numbers, NaN where there is none; words are counted.

    Raises:
        InputError: not one number, or a numeral that is none with this decimal sign.
    """
    cells = export.cells[source.theirs]
    found = np.empty(len(cells))
    words = 0
    for row, cell in enumerate(cells):
        if not isinstance(cell, str):
            found[row] = cell
            continue
        value = number(cell, decimal)
        if value is None or (isnan(value) and begins_number(cell)):
            match = _WITH_UNIT.fullmatch(cell)
            value = number(match[1], decimal) if match and unit_named(match[2]) else value
        if value is None:
            other = "," if decimal == "." else "."
            raise InputError(
                str(path),
                f"{export.header.table.place} {export.lines[row]}: {cell!r} in {source.theirs!r} is no number with the "
                f"decimal sign {decimal}; if the file's is the other, --decimal {other}",
            )
        found[row] = value
        words += bool(cell) and isnan(value)
    found[~np.isfinite(found)] = np.nan
    if np.isnan(found).all():
        holds = ", ".join(sorted({repr(str(cell)) for cell in cells})[:3])
        remedy = "map another" if source.name in REQUIRED else f"leave out {source.name}"
        raise InputError(str(path), f"column {source.theirs!r} holds no number, only {holds}: {remedy}")
    if words:
        metadata[f"not numbers in {source.theirs}"] = str(words)
    return found


def _time(
    path: Path, export: _Export, source: Source, unit: str, decimal: str, options: ExportOptions
) -> tuple[Column, bool, float | None]:
    """Return the time, s, of each row, without a footer's, whether it is from stamps, and where local ones begin."""
    cells = export.cells[source.theirs]
    while cells and not begins_number(cells[-1]) and len(export.lines) - len(cells) < FOOTER:
        if len(cells) == 1 or not _number_above(cells):
            break
        cells.pop()
    _cut(export, source.theirs, len(cells))
    first = next((cell for cell in cells if cell != ""), "")
    stamped = unit == "iso" or options.time_format is not None or (isinstance(first, str) and not is_numeral(first))
    stamped = stamped and not (isinstance(first, str) and _behind_numbers(export, source))
    if stamped and all(isinstance(cell, str) for cell in cells):
        texts = [str(cell) for cell in cells]
        seconds, local_from_s = seconds_of(path, texts, export.lines, options.time_format)
        return seconds, True, local_from_s
    seconds = np.array([cell if isinstance(cell, float) else _second(cell, decimal) for cell in cells])
    if source.unit is None and (likely := clock_unit(seconds)) is not None and unit == "s":
        problem = f"{cells[0]!r} in {source.theirs!r} is no time in seconds"
        raise InputError(str(path), f"{problem}: type --column time_s={source.theirs}:{likely[0]}, {likely[1]}")
    if np.isnan(seconds).any():
        row = int(np.isnan(seconds).argmax())
        raise InputError(
            str(path),
            f"sample {row + 1} (line {export.lines[row]}): {cells[row]!r} is neither seconds nor an ISO time stamp",
        )
    return seconds * UNITS["_s"][unit], False, None


def _number_above(cells: Sequence[Cell]) -> bool:
    return any(begins_number(cell) for cell in cells[-FOOTER - 1 : -1])


def _cut(export: _Export, clock: str, kept: int) -> None:
    """Leave out the rows of a footer."""
    if (dropped := len(export.lines) - kept) > 0:
        export.notes["rows without a time at the end, left out"] = str(dropped)
        for name, column in export.cells.items():
            if name != clock:
                del column[kept:]
        del export.lines[kept:]


def _second(cell: Cell, decimal: str) -> float:
    match = _WITH_UNIT.fullmatch(str(cell))
    value = number(match[1] if match and unit_named(match[2]) else str(cell), decimal)
    return np.nan if value is None else value


def _in_si(raw: Column, source: Source, unit: str, stroke_m: float | None, range_pa: tuple[float, float]) -> Column:
    """Return a column in SI units; see `export_units`."""
    ending, plain = ending_of(source.name), unit.removeprefix("-")
    turned = plain != unit
    if ending == "_m" and (plain in SHARES or turned) and stroke_m is None:
        raise InputError("--stroke-m", f"is needed to read {source.name} in {unit}; give what 100 % is, in metres")
    if plain in SHARES and plain not in UNITS[ending]:  # mA are a share of 4 to 20, but of a drive a current
        factor, offset = SHARES[plain]
        share = factor * raw + offset
        share = 1.0 - share if turned else share
        low, high = (0.0, stroke_m or 0.0) if ending == "_m" else range_pa
        return np.asarray(low + (high - low) * share)
    si = UNITS[ending][plain] * raw - (ATMOSPHERE_PA if plain in ABSOLUTE else 0.0)
    return np.asarray((stroke_m or 0.0) - si if turned else si)

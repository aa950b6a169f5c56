"""A historian's export as a recording: columns by their own names and units, made SI.

A mapping says which column is which, `position_m=PV:%`: our name, theirs, their unit (SI if it is left out). Fields
are separated by commas, semicolons or tabs; where a comma does not separate, it may be the decimal sign. Time is in
seconds, or in ISO 8601 time stamps and then counted from the first. Rows are kept as they come: what is not a number
becomes NaN and is told in the metadata, for the workbench to handle.
"""

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from config.errors import InputError
from config.recording import REQUIRED, Column, Recording

UNITS: Mapping[str, Mapping[str, float]] = {
    "_s": {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0, "iso": 1.0},
    "_pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "mbar": 100.0, "bar": 1e5, "psi": 6894.757293168},
    "_m": {"m": 1.0, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "_n": {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605},
}
"""By the ending of our name: their unit in ours. `%` is of the stroke for a position, of a range for a pressure."""
RANGE_PA = (0.2e5, 1.0e5)
"""The pressures of 0 % and 100 %: the field's usual 0.2 to 1 bar, unless another range is given."""


@dataclass(frozen=True, slots=True)
class Source:
    """Where one of our columns comes from."""

    name: str
    theirs: str
    unit: str


def read_mapping(words: Sequence[str]) -> tuple[Source, ...]:
    """Read `OURS=THEIRS` or `OURS=THEIRS:UNIT`, one a column.

    Raises:
        InputError: no such form, an unknown unit (names those there are), or a column that stands twice.
    """
    sources = tuple(_source(word) for word in words)
    names = [each.name for each in sources]
    for name in (*REQUIRED, *names):
        if names.count(name) != 1:
            raise InputError("--column", f"{name} is given {names.count(name)} times; once is required")
    return sources


def _source(word: str) -> Source:
    match = re.fullmatch(r"(\w+?(_s|_pa|_m|_n))=(.+?)(?::([^:]*))?", word)
    if match is None:
        raise InputError(
            "--column", f"{word!r}: must be OURS=THEIRS:UNIT, OURS ending in _s, _pa, _m or _n (position_m=PV:%)"
        )
    name, ending, theirs, unit = match.groups()
    allowed = [*UNITS[ending], *(["%"] if ending in ("_pa", "_m") else [])]
    si = ending[1:] if ending not in ("_pa", "_n") else {"_pa": "Pa", "_n": "N"}[ending]
    if unit is not None and unit not in allowed:
        raise InputError("--column", f"{word!r}: unknown unit {unit!r}; allowed: {', '.join(allowed)}")
    return Source(name, theirs, unit or si)


def read_export(
    path: Path,
    sources: Sequence[Source],
    stroke_m: float,
    range_pa: tuple[float, float] = RANGE_PA,
) -> Recording:
    """Read an export.

    Args:
        path: the file.
        sources: the columns, see `read_mapping`.
        stroke_m: 100 % of a position.
        range_pa: 0 % and 100 % of a pressure.

    Raises:
        InputError: the file cannot be read, lacks a column, or holds no sample or no readable time.
    """
    header, rows, separator = _cells(path)
    metadata = {"imported": ", ".join(f"{each.name} from {each.theirs} in {each.unit}" for each in sources)}
    columns: dict[str, Column] = {}
    for source in sources:
        if source.theirs not in header:
            raise InputError(str(path), f"column {source.theirs!r} is missing; line 1 names: {', '.join(header)}")
        index = header.index(source.theirs)
        cells = [row[index].strip() if index < len(row) else "" for row in rows]
        if source.name == "time_s":
            columns["time_s"] = _time(path, cells, source.unit, separator)
            continue
        raw = np.array([_number(cell, separator) for cell in cells])
        words = sum(bool(cell) for cell, value in zip(cells, raw, strict=True) if np.isnan(value))
        if words:
            metadata[f"not numbers in {source.theirs}"] = str(words)
        columns[source.name] = _in_si(raw, source, stroke_m, range_pa)
    return Recording({name: columns[name] for name in sorted(columns, key=_contract_order)}, metadata)


def _contract_order(name: str) -> tuple[int, str]:
    return (REQUIRED.index(name), "") if name in REQUIRED else (len(REQUIRED), name)


def _cells(path: Path) -> tuple[list[str], list[list[str]], str]:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(str(path), "is not UTF-8 text") from None
    lines = [line for line in lines if line.strip() and not line.startswith("#")]
    if len(lines) < 2:
        raise InputError(str(path), "holds no samples")
    separator = next((each for each in ("\t", ";") if each in lines[0]), ",")
    table = [[cell.strip() for cell in row] for row in csv.reader(lines, delimiter=separator)]
    return table[0], table[1:], separator


def _number(cell: str, separator: str) -> float:
    """Read a number; NaN if it is none (historians write `Bad`, `No Data`)."""
    try:
        return float(cell.replace(",", ".") if separator != "," else cell)
    except ValueError:
        return np.nan


def _time(path: Path, cells: list[str], unit: str, separator: str) -> Column:
    seconds = np.array([_number(cell, separator) for cell in cells]) * UNITS["_s"][unit]
    if unit == "iso" or np.isnan(seconds).all():
        stamps = np.array([_stamp(path, cell, row) for row, cell in enumerate(cells, start=1)])
        seconds = stamps - stamps[0]
    if np.isnan(seconds).any():
        row = int(np.isnan(seconds).argmax())
        raise InputError(str(path), f"sample {row + 1}: {cells[row]!r} is neither seconds nor an ISO time stamp")
    return seconds


def _stamp(path: Path, cell: str, row: int) -> float:
    try:
        stamp = datetime.fromisoformat(cell.replace(",", "."))
    except ValueError:
        raise InputError(
            str(path), f"sample {row}: {cell!r} is neither seconds nor an ISO time stamp (2026-01-31T12:00:00.5)"
        ) from None
    return (stamp if stamp.tzinfo else stamp.replace(tzinfo=UTC)).timestamp()


def _in_si(raw: Column, source: Source, stroke_m: float, range_pa: tuple[float, float]) -> Column:
    if source.unit == "%" and source.name.endswith("_pa"):
        return np.asarray(range_pa[0] + (range_pa[1] - range_pa[0]) * raw / 100.0)
    if source.unit == "%":
        return np.asarray(stroke_m * raw / 100.0)
    ending = re.search(r"_(s|pa|m|n)$", source.name)
    assert ending is not None
    return np.asarray(UNITS[ending.group()][source.unit] * raw)

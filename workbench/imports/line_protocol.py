r"""InfluxDB's line protocol: what its backups, `influx_inspect export -lponly`, and Telegraf's file output hold.

    measurement,tag=value field=1.0,other=2i 1700000000000000000        a point a line

Points of one time stamp make a row, whatever their series; a column is a field, named with its measurement, and
its tags too, where the field's name alone says not whose it is. Time stamps count from 1970, in ns, us, ms or s by
their digits; the rows' times from the first.
Of its values: 1.0, 2i, 3u, t, "words"; \ before a space, a comma or = makes it a part of a name.
"""

import re
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from config.errors import InputError
from config.plain_file import read_plain, require_moderate
from workbench.imports.raw_table import Cell, RawTable

TIME = "time"
WORD = r"(?:\\.|[^\s,=\\])+"
VALUE = r'(?:"(?:\\.|[^"\\])*"|[^\s,"]+)'
PAIR = re.compile(rf"({WORD})=({VALUE})(?:,|$)")
POINT = re.compile(rf"({WORD}(?:,{WORD}={WORD})*) +({WORD}={VALUE}(?:,{WORD}={VALUE})*) +(-?\d+)\s*")
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?[iu]?")
UNITS = ((17, 1e-9), (14, 1e-6), (12, 1e-3), (0, 1.0))
"""Seconds of a time stamp's unit, by how many digits it has at least: any time from 1973 to 2286 is told so."""

Column = tuple[str, str]
"""A series, measurement and tags, and a field of it."""


def is_line_protocol(begin: bytes) -> bool:
    """Return whether the first line that is no comment is a point; of the bytes with which a file begins."""
    lines = begin.decode("utf-8", errors="replace").splitlines()
    return any(POINT.fullmatch(line) is not None for line in lines[:1])


def line_protocol(path: Path) -> list[RawTable]:
    """Return the table of its points.

    Raises:
        InputError: a line that is no point, names it; more rows than can be read.
    """
    rows: dict[int, dict[Column, Cell]] = {}
    columns: dict[Column, None] = {}
    for number, line in enumerate(read_plain(path).splitlines(), start=1):
        if not line.strip() or line.startswith("#"):
            continue
        point = POINT.fullmatch(line)
        if point is None:
            raise InputError(str(path), f"line {number}: is no point with a time stamp: {line[:60]!r}")
        series, fields, stamp = point.groups()
        row = rows.setdefault(int(stamp), {})
        for name, value in PAIR.findall(fields):
            row[series, _plain(name)] = _cell(value)
            columns.setdefault((series, _plain(name)))
    require_moderate(path, len(rows), len(columns))
    first = min(rows)
    recorded = datetime.fromtimestamp(first * _unit_s(first), UTC).isoformat()
    reading = partial(_rows, rows, tuple(columns))
    return [RawTable("line protocol", "row", reading, notes=(("recorded", recorded),))]


def _rows(rows: dict[int, dict[Column, Cell]], columns: tuple[Column, ...]) -> Iterator[tuple[int, list[Cell]]]:
    yield 0, [TIME, *_names(columns)]
    first = min(rows)
    unit_s = _unit_s(first)
    for number, (stamp, row) in enumerate(sorted(rows.items()), start=1):
        yield number, [(stamp - first) * unit_s, *(row.get(column, "") for column in columns)]


def _names(columns: tuple[Column, ...]) -> list[str]:
    """Return the shortest name of each column that is no other's."""
    candidates = [(field, f"{_measurement(series)}.{field}", f"{_plain(series)}.{field}") for series, field in columns]
    held = [Counter(each) for each in zip(*candidates, strict=True)]
    return [
        next((name for name, count in zip(names, held, strict=True) if count[name] == 1), names[-1])
        for names in candidates
    ]


def _measurement(series: str) -> str:
    return _plain(re.split(r"(?<!\\),", series)[0])


def _plain(word: str) -> str:
    return re.sub(r"\\([ ,=\\])", r"\1", word)


def _cell(value: str) -> Cell:
    if NUMBER.fullmatch(value):
        return float(value.rstrip("iu"))
    return value[1:-1].replace('\\"', '"').replace("\\\\", "\\") if value.startswith('"') else value


def _unit_s(stamp: int) -> float:
    return next(unit for digits, unit in UNITS if len(str(abs(stamp))) >= digits)

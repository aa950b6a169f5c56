"""The line that names the columns: the first that holds all names that are asked for, whatever stands before it.

A column is named as in the file, in whatever case and spacing, with or without the unit behind it; by `#2` as the
second of a file that names none; and by `Date+Time` as two, joined by a space. Under the header rows without a number
may say units.
"""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice, takewhile
from pathlib import Path

from config.errors import InputError
from config.exports.export_units import unit_in_header, unit_named
from config.exports.raw_table import Cell, RawTable

SEARCHED = 300
"""Rows among which the header must be."""
BELOW = 3
"""Rows between the header and the samples at most."""
ROW_A_COLUMN = 10
"""Cells of a row, from which on one that begins with a name is taken for a signal."""
SHOWN = 30
"""Names that a message lists at most."""
_NUMBER_BEGINS = re.compile("[+\u2212-]?[.,]?\\d")


@dataclass(frozen=True, slots=True)
class Header:
    """Where the columns are.

    Attributes:
        table: the reading of the file that has them.
        line: number of the header's line; 0 for a file without.
        names: as the header has them.
        at: the columns of each name that was asked for: one, or several to be joined.
        samples_after: number of the last line that is no sample.
        units: what the file says of the unit of each name asked for, with the number of the line that says so.
        unknown: what stands in a unit's place and is none that is known.
    """

    table: RawTable
    line: int
    names: tuple[str, ...]
    at: Mapping[str, tuple[int, ...]]
    samples_after: int
    units: Mapping[str, tuple[str, int]] = field(default_factory=dict)
    unknown: Mapping[str, str] = field(default_factory=dict)


def begins_number(cell: Cell) -> bool:
    """Return whether a cell is, or begins as, a number or a date."""
    return not isinstance(cell, str) or _NUMBER_BEGINS.match(cell) is not None


def find_header(path: Path, tables: Sequence[RawTable], wanted: Sequence[str]) -> Header:
    """Return where the columns of the names that are wanted are.

    Raises:
        InputError: no line holds them all, one stands twice in it, or several sheets or groups hold them.
    """
    found: list[Header] = []
    broken: list[InputError] = []
    for table in tables:
        try:
            if header := _header_of(path, table, wanted):
                found.append(header)
        except InputError as error:  # as it would be read with a separator that is none
            broken.append(error)
    if len({each.table.sheet for each in found}) > 1:
        sheets = ", ".join(repr(each) for each in dict.fromkeys(each.table.sheet for each in found))
        plural = "sheets" if found[0].table.what.startswith("sheet ") else "groups"
        raise InputError(str(path), f"the {plural} {sheets} all have these columns: say which, --sheet NAME")
    if not found:
        raise broken[0] if broken else _missing(path, tables, wanted)
    return _with_units(found[0])


def _header_of(path: Path, table: RawTable, wanted: Sequence[str]) -> Header | None:
    if all(re.fullmatch(r"#\d+", each) for each in wanted):
        return _by_numbers(table, wanted)
    for line, cells in islice(table.rows(), SEARCHED):
        at = _places(path, line, table.place, cells, wanted)
        if at is not None:
            names = tuple(str(cell) for cell in cells)
            return Header(table, line, names, at, line)
    return None


def _by_numbers(table: RawTable, wanted: Sequence[str]) -> Header | None:
    """Return the columns of a file without names: the samples begin where all of them begin as numbers."""
    at = {each: (int(each[1:]) - 1,) for each in wanted}
    before = 0
    for line, cells in islice(table.rows(), SEARCHED):
        if all(0 <= index < len(cells) and begins_number(cells[index]) for (index,) in at.values()):
            names = tuple(f"#{index + 1}" for index in range(len(cells)))
            return Header(table, 0, names, at, before)
        before = line
    return None


def _places(
    path: Path, line: int, place: str, cells: Sequence[Cell], wanted: Sequence[str]
) -> dict[str, tuple[int, ...]] | None:
    names = [str(cell) for cell in cells]
    at = {}
    for each in wanted:
        parts = [each] if _matches(names, each) or "+" not in each else each.split("+")
        places = [_matches(names, part.strip()) for part in parts]
        if not all(places):
            return None
        for part, matched in zip(parts, places, strict=True):
            if len(matched) > 1:
                raise InputError(
                    str(path), f"column {part!r} stands {len(matched)} times in {place} {line}: name them apart there"
                )
        at[each] = tuple(matched[0] for matched in places)
    return at


def _matches(names: Sequence[str], wanted: str) -> list[int]:
    """Return where a name stands: as it is, else in any case and spacing, else without its unit."""
    if wanted.startswith("#") and wanted[1:].isdigit() and 0 < int(wanted[1:]) <= len(names):
        return [int(wanted[1:]) - 1]
    for form in (str, _loose, lambda name: _loose(unit_in_header(name)[0])):
        found = [index for index, name in enumerate(names) if form(name) == form(wanted)]
        if found:
            return found
    return []


def _loose(name: str) -> str:
    return " ".join(name.split()).casefold()


def _with_units(header: Header) -> Header:
    """Return the header with the units in it and in the rows under it, and where the samples begin."""
    units: dict[str, tuple[str, int]] = {}
    unknown: dict[str, str] = {}
    used = {index for places in header.at.values() for index in places}
    for name, (first, *_) in header.at.items():
        if header.line and (unit := unit_in_header(header.names[first])[1]):
            units[name] = (unit, header.line)
    last = header.samples_after
    below = (row for row in header.table.rows() if row[0] > last and any(cell != "" for cell in row[1]))
    for line, cells in islice(below, BELOW if header.line else 0):
        if any(index < len(cells) and begins_number(cells[index]) for index in used):
            break
        last = line
        for name, (first, *_) in header.at.items():
            text = str(cells[first]) if first < len(cells) else ""
            if unit := unit_named(text):
                units.setdefault(name, (unit, line))
            elif text:
                unknown.setdefault(name, text)
    return Header(header.table, header.line, header.names, header.at, last, units, unknown)


def _missing(path: Path, tables: Sequence[RawTable], wanted: Sequence[str]) -> InputError:
    """Return what to say of a file that lacks a column: which, and what it has."""
    guess = guess_header(tables)
    if guess is None:
        return InputError(str(path), f"holds no table: no two of its first {SEARCHED} lines have the same columns")
    parts = [part for each in wanted for part in ([each] if "+" not in each else each.split("+"))]
    absent = [each for each in parts if not _matches(guess.names, each)] or parts[:1]
    missing = absent[0]
    if apart := _apart(tables, parts):
        return InputError(str(path), apart)
    if said := next((said for each in absent if (said := _in_the_rows(guess, each))), None):
        return InputError(str(path), said)
    if not guess.line and guess.names[0] == "#1":
        return InputError(
            str(path), f"column {missing!r} is missing: no line names columns; call them #1 to #{len(guess.names)}"
        )
    named = ", ".join(name for name in guess.names[:SHOWN] if name)
    more = f" and {len(guess.names) - SHOWN} more" if len(guess.names) > SHOWN else ""
    where = f"{guess.table.place} {guess.line} names" if guess.line else "there are"
    return InputError(str(path), f"column {missing!r} is missing; {where}: {named}{more}")


def _apart(tables: Sequence[RawTable], parts: Sequence[str]) -> str | None:
    """Return what to say where each column stands in some table, and no table has them all: they are of other times."""
    held = [(table, [part for part in parts if _names_it(table, part)]) for table in tables if table.place == "row"]
    left = list(dict.fromkeys(parts))
    said: list[str] = []
    for table, of_it in sorted(held, key=lambda each: -len(each[1])):
        if found := [part for part in left if part in of_it]:
            said.append(f"{', '.join(map(repr, found))} in {table.what}")
            left = [part for part in left if part not in found]
    if left or len(said) < 2:
        return None
    return f"its columns stand in tables of other times: {'; '.join(said)}; export them on one time"


def _names_it(table: RawTable, part: str) -> bool:
    try:
        return any(_matches([str(cell) for cell in cells], part) for _, cells in islice(table.rows(), SEARCHED))
    except InputError:
        return False


def _in_the_rows(guess: Header, name: str) -> str | None:
    """Return what to say where a name that is missing stands in a row: the table is turned, or a value is a row."""
    for line, cells in islice(guess.table.rows(), SEARCHED):
        at = [index for index, cell in enumerate(cells) if line != guess.line and str(cell).strip() == name]
        if at and at[0] == 0 and _width(cells) > ROW_A_COLUMN:
            return (
                f"{name!r} begins {guess.table.place} {line}: a row a signal; turn the table, a column a signal, "
                "as Excel's Paste Special, Transpose does"
            )
        if at and guess.line and at[0] < len(guess.names):
            return (
                f"{name!r} stands in {guess.table.place} {line} under {guess.names[at[0]]!r}: a row a value; "
                "turn it into a column a signal, as pandas' DataFrame.pivot does"
            )
    return None


def guess_header(tables: Sequence[RawTable]) -> Header | None:
    """Return the likeliest reading of a file and the header in it, nothing being known of its columns."""
    guesses = [guess for table in tables if (guess := _guess(table)) is not None]
    if not guesses:
        return None
    best = max(guesses, key=lambda each: each[0])
    return best[1]


def _guess(table: RawTable) -> tuple[tuple[bool, int, int], Header] | None:
    try:
        rows = [(line, cells) for line, cells in islice(table.rows(), SEARCHED) if any(cell != "" for cell in cells)]
    except InputError:
        return None
    widths = Counter(width for _, cells in rows if (width := _width(cells)) > 1)
    if not widths:
        return None
    width, count = max(widths.items(), key=lambda each: (each[1], each[0]))
    line, cells = _names(rows, width)
    named = _is_words(cells)
    names = tuple(str(cell) if named else f"#{index}" for index, cell in enumerate(cells, start=1))
    at = {name: (index,) for index, name in enumerate(names) if name}
    before = max((number for number, _ in rows if number < line), default=0)
    header = Header(table, line if named else 0, names, at, line if named else before)
    return (named, count, width), _with_units(header)


def _names(rows: Sequence[tuple[int, list[Cell]]], width: int) -> tuple[int, list[Cell]]:
    """Return the row that names the most of the columns that samples have; it may name some that hold nothing.

    Of several it is one of just as many columns, and of these the first. A file without names: its first sample.
    """
    wide = [row for row in rows if _width(row[1]) >= width]
    above = list(takewhile(lambda row: _is_words(row[1]), wide))
    if not above:
        return next(row for row in rows if _width(row[1]) == width)
    return max(above, key=lambda row: (sum(cell != "" for cell in row[1][:width]), _width(row[1]) == width))


def _is_words(cells: Sequence[Cell]) -> bool:
    words = [cell for cell in cells if cell != "" and not begins_number(cell)]
    return 2 * len(words) > sum(cell != "" for cell in cells)


def _width(cells: Sequence[Cell]) -> int:
    """Return how many cells there are up to the last that holds something."""
    return max((index for index, cell in enumerate(cells, start=1) if cell != ""), default=0)

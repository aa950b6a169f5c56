"""The line that names the columns: the first that holds all names that are asked for, whatever stands before it.

A column is named as in the file, in whatever case and spacing, with or without the unit behind it; by `#2` as the
second of a file that names none; and by `Date+Time` as two, joined by a space. Under the header rows without a number
may say units.
"""

import re
from collections import Counter, deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice, takewhile
from pathlib import Path

from config.errors import InputError
from workbench.imports.cell_kinds import begins_number, may_be_clock
from workbench.imports.cell_units import UNITS, unit_in_header, unit_named
from workbench.imports.column_names import COMMON, rank_by_name
from workbench.imports.raw_table import Cell, RawTable
from workbench.imports.stated_duration import stated_duration_s, unit_by_duration

SEARCHED = 300
"""Rows among which the header must be."""
BELOW = 12
"""Rows between the header and the samples at most."""
SURELY_SAMPLES = 40
"""Rows under the header, and at the end, by which a clock is told that nobody has named."""
SHOWN = 30
"""Names that a message lists at most."""


class ColumnMissing(InputError):
    """No line of any table holds all names."""


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
        as_written: the names before those that stand several times were told apart.
        clock: the name of the clock's column, among those asked for.
        lasts: what the rows above say of the unit of clocks; "" where they are silent.
    """

    table: RawTable
    line: int
    names: tuple[str, ...]
    at: Mapping[str, tuple[int, ...]]
    samples_after: int
    units: Mapping[str, tuple[str, int]] = field(default_factory=dict)
    unknown: Mapping[str, str] = field(default_factory=dict)
    as_written: tuple[str, ...] = ()
    clock: str | None = None
    lasts: str = ""


def find_header(path: Path, tables: Sequence[RawTable], wanted: Sequence[str], clock: str | None = None) -> Header:
    """Return where the columns of the names that are wanted are; the clock's name may stand several times.

    The likeliest reading of the file is looked at first, the one that a preview shows.

    Raises:
        InputError: no line holds them all, one stands twice in it, or several sheets or groups hold them.
    """
    found: list[Header] = []
    broken: list[InputError] = []
    for table in likeliest_first(tables):
        try:
            if header := _header_of(path, table, wanted, clock):
                found.append(header)
        except InputError as error:  # as it would be read with a separator that is none
            broken.append(error)
    if len({each.table.sheet for each in found}) > 1:
        sheets = ", ".join(repr(each) for each in dict.fromkeys(each.table.sheet for each in found))
        plural = "sheets" if found[0].table.what.startswith("sheet ") else "groups"
        raise InputError(str(path), f"the {plural} {sheets} all have these columns: say which, --sheet NAME")
    if not found:
        raise broken[0] if broken and len(broken) == len(tables) else ColumnMissing(str(path), _missing(tables, wanted))
    return with_units(found[0])


def likeliest_first(tables: Sequence[RawTable]) -> list[RawTable]:
    """Return the readings of a file, the one that a preview shows first, and those that are none last."""
    if len(tables) < 2:
        return list(tables)
    guesses = [(guess[0] if (guess := _guess(table)) else (False, 0, 0), table) for table in tables]
    return [table for _, table in sorted(guesses, key=lambda each: each[0], reverse=True)]


def _header_of(path: Path, table: RawTable, wanted: Sequence[str], clock: str | None) -> Header | None:
    if all(re.fullmatch(r"#\d+", each) for each in wanted):
        return _by_numbers(table, wanted)
    above: Sequence[Cell] = ()  # of the line before: one that is blank parts a table from what is said of it
    for line, cells in islice(table.rows(), SEARCHED):
        written = tuple(map(str, cells))
        names = distinguish_names(written, above)
        at = _places(path, f"{table.place} {line}", names, written, wanted, clock)
        if at is not None:
            return Header(table, line, names, at, line, as_written=written, clock=clock)
        above = cells
    return None


def distinguish_names(names: Sequence[str], above: Sequence[Cell]) -> tuple[str, ...]:
    """Return the names of a row; those that stand several times with what stands above their group before them.

    >>> distinguish_names(["Time", "Value", "Time", "Value"], ["FV1.OP", "", "FV1.ZT", ""])
    ('FV1.OP Time', 'FV1.OP Value', 'FV1.ZT Time', 'FV1.ZT Value')
    """
    several = {name for name, count in Counter(names).items() if count > 1 and name}
    group, told = "", list(names)
    for index, name in enumerate(names):
        group = str(above[index]) if index < len(above) and above[index] != "" else group
        if name in several and group:
            told[index] = f"{group} {name}"
    return tuple(told) if len(set(told)) - len(set(names)) >= len(several) else tuple(names)


def _by_numbers(table: RawTable, wanted: Sequence[str]) -> Header | None:
    """Return the columns of a file without names: the samples begin where all of them begin as numbers."""
    at = {each: (int(each[1:]) - 1,) for each in wanted}
    before, above = 0, tuple[str, ...]()
    for line, cells in islice(table.rows(), SEARCHED):
        if all(0 <= index < len(cells) and begins_number(cells[index]) for (index,) in at.values()):
            names = tuple(f"#{index + 1}" for index in range(len(cells)))
            return Header(table, 0, names, at, before, as_written=above if len(above) == len(names) else ())
        before, above = line, tuple(map(str, cells))
    return None


def _places(
    path: Path, where: str, names: Sequence[str], written: Sequence[str], wanted: Sequence[str], clock: str | None
) -> dict[str, tuple[int, ...]] | None:
    at = {}
    for each in wanted:
        parts = [each] if matches(names, each, written) or "+" not in each else each.split("+")
        places = [matches(names, part.strip(), written) for part in parts]
        if not all(places):
            return None
        for part, matched in zip(parts, places, strict=True):
            if len(matched) > 1 and each != clock:
                numbers = ", ".join(f"#{index + 1}" for index in matched)
                raise InputError(
                    str(path),
                    f"column {part!r} stands {len(matched)} times in {where}: call it by its place, {numbers}",
                )
        at[each] = tuple(matched[0] for matched in places)
    return at


def matches(names: Sequence[str], wanted: str, as_written: Sequence[str] = ()) -> list[int]:
    """Return where a name stands: as it is, else in any case and spacing, else without its unit.

    Names that were told apart also stand where they do as written.
    """
    if wanted.startswith("#") and wanted[1:].isdigit() and 0 < int(wanted[1:]) <= len(names):
        return [int(wanted[1:]) - 1]
    for form in (str, _loose, lambda name: _loose(unit_in_header(name)[0])):
        sought = form(wanted)
        for each in (names, as_written):
            if found := [index for index, name in enumerate(each) if form(name) == sought]:
                return found
    return []


def _loose(name: str) -> str:
    return " ".join(name.split()).casefold()


TYPES = "#TYPES"
"""In Ignition's exports the line above the kinds of the columns: D is a number there, and no day."""


def with_units(header: Header) -> Header:
    """Return the header with the units in it and in the rows under it, and where the samples begin."""
    units: dict[str, tuple[str, int]] = {}
    unknown: dict[str, str] = {}
    for name, (first, *_) in header.at.items():
        if header.line and (unit := unit_in_header(header.names[first])[1]):
            units[name] = (unit, header.line)
    last = header.line or header.samples_after
    below = [row for row in _from(header.table, last, BELOW + SURELY_SAMPLES) if any(cell != "" for cell in row[1])]
    decisive = _decisive(header, [cells for _, cells in below[BELOW:]])
    under = list(takewhile(lambda row: not _any_number(row[1], decisive), below[: BELOW if header.line else 0]))
    while under and _any_number(under[-1][1], {index for places in header.at.values() for index in places}):
        under.pop()  # a sample without a readable time, and not the end of what is said under the header
    typed = False
    for line, cells in under:
        last = line
        was_typed, typed = typed, cells[0] == TYPES
        if was_typed:
            continue
        for name, (first, *_) in header.at.items():
            text = str(cells[first]) if first < len(cells) else ""
            if unit := unit_named(text) or _unit_of_time_in(text):
                units.setdefault(name, (unit, line))
            elif text:
                unknown.setdefault(name, text)
    return _with_stated_unit(replace(header, samples_after=last, units=units, unknown=unknown))


def _with_stated_unit(header: Header) -> Header:
    """Return the header with the unit of its clocks by the begin and the end that stand above it."""
    lasts_s = stated_duration_s(cells for _, cells in islice(header.table.rows(), max(0, header.line - 1)))
    if not lasts_s:  # not told, or begin and end are one
        return header
    samples = (cells for _, cells in _from(header.table, header.samples_after, None))
    rows = [*islice(samples, SURELY_SAMPLES), *deque(samples, SURELY_SAMPLES)]
    written, told = header.as_written or header.names, dict[str, tuple[str, int]]()
    for name, (first, *_) in header.at.items():
        if name in header.units or (name != header.clock and (header.clock or _is_signal(name))):
            continue
        alike = [index for index, each in enumerate(written) if each == written[first]]
        columns = ([cells[index] for cells in rows if index < len(cells)] for index in alike)
        if unit := unit_by_duration(columns, header.table.separator, lasts_s):
            told[name] = (unit, header.line)
    said = [f"; above it the recording lasts {lasts_s:g} s, so that {name!r} counts {told[name][0]}" for name in told]
    return replace(header, units={**header.units, **told}, lasts=said[0] if said else "")


def _is_signal(name: str) -> bool:
    """Return whether a column is called like a signal, and not like a time."""
    return rank_by_name("time_s", name) is None and any(rank_by_name(ours, name) is not None for ours in COMMON)


def _unit_of_time_in(text: str) -> str | None:
    """Return the unit in which a clock's column is described: TwinCAT writes `SampleTime[ms]` into it."""
    unit = unit_in_header(text)[1]
    return unit if unit in UNITS["_s"] else None


def _from(table: RawTable, line: int, count: int | None) -> Iterator[tuple[int, list[Cell]]]:
    return islice((row for row in table.rows() if row[0] > line), count)


def _any_number(cells: Sequence[Cell], places: Collection[int]) -> bool:
    return any(index < len(cells) and begins_number(cells[index]) for index in places)


def _decisive(header: Header, rows: Sequence[Sequence[Cell]]) -> set[int]:
    """Return the columns of which one that begins as a number begins the samples: clocks, if any is known or told."""
    used = {index for places in header.at.values() for index in places}
    if header.clock is not None and header.clock in header.at:
        return set(header.at[header.clock])
    named = {index for index in used if rank_by_name("time_s", header.names[index]) is not None}
    told = {index for index in used if may_be_clock([cells[index] for cells in rows if index < len(cells)])}
    return named | told or used


def _missing(tables: Sequence[RawTable], wanted: Sequence[str]) -> str:
    """Return what to say of a file that lacks a column: which, and what it has."""
    guess = guess_header(tables)
    if guess is None:
        return f"holds no table: no two of its first {SEARCHED} lines have the same columns"
    parts = [part for each in wanted for part in ([each] if "+" not in each else each.split("+"))]
    missing = next((each for each in parts if not matches(guess.names, each, guess.as_written)), parts[0])
    if not guess.line and guess.names[0] == "#1":
        return f"column {missing!r} is missing: no line names columns; call them #1 to #{len(guess.names)}"
    named = ", ".join(name for name in guess.names[:SHOWN] if name)
    more = f" and {len(guess.names) - SHOWN} more" if len(guess.names) > SHOWN else ""
    where = f"{guess.table.place} {guess.line} names" if guess.line else "there are"
    return f"column {missing!r} is missing; {where}: {named}{more}"


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
    written = tuple(map(str, cells))
    names = distinguish_names(written, next((row for number, row in rows if number == line - 1), ()))
    names = tuple(
        f"#{index + 1}" if not named or not name or name in names[:index] else name for index, name in enumerate(names)
    )
    at = {name: (index,) for index, name in enumerate(names) if name}
    before = max((number for number, _ in rows if number < line), default=0)
    header = Header(table, line if named else 0, names, at, line if named else before, as_written=written)
    return (named, count, width), with_units(header)


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

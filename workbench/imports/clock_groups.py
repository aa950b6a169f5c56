"""Which clock each column goes by: one of the whole table, or each its own.

    Time  OP  ZT                     one clock, whatever else counts time beside it
    Time  OP  Time  ZT               pairs: a column goes by the nearest clock to its left, of that name or another
    sheet OP: Time Value             a sheet, a group or a tag: each table has its own, and a table of one signal is
    sheet ZT: Time Value             called by the table's name

Rows of different clocks are no rows of one moment: each group is read by itself, and `clock_join` lays them together.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

from config.errors import InputError
from workbench.imports.cell_kinds import may_be_clock
from workbench.imports.column_names import rank_by_name
from workbench.imports.header_search import ColumnMissing, Header, find_header, guess_header, matches, with_units
from workbench.imports.raw_table import Cell, RawTable
from workbench.imports.turned_tables import cells_at, table_of_signal, turn_table, value_places

DISTINCT = 0.4
"""Part of a clock's times that differ: two rows of a second are so many."""
LOOKED_AT = 200
"""Rows by which a column is told to be a clock."""


def find_groups(
    path: Path, tables: Sequence[RawTable], clock: str | None, wanted: Sequence[str], status: Sequence[str] = ()
) -> list[Header]:
    """Return where the columns that are wanted are, those of one clock each; `Header.at` has the clock by its name.

    Args:
        path: for messages.
        tables: the readings of the file.
        clock: the name of the clock's column; None for a file without.
        wanted: names of the other columns.
        status: names of columns that say which rows are good; each goes with the columns of its table.

    Raises:
        InputError: as `find_header`; or columns that are apart have no clock.
    """
    names = list(dict.fromkeys([*([] if clock is None else [clock]), *wanted, *status]))
    try:
        header = _in_one_table(path, tables, names, clock)
    except ColumnMissing as missing:
        apart = _in_tables_of_their_own(path, tables, clock, wanted, status)
        if not apart:
            raise missing from None
        return apart
    return [header] if clock is None else _of_own_clocks(header, clock, wanted, status)


def _in_one_table(path: Path, tables: Sequence[RawTable], names: Sequence[str], clock: str | None) -> Header:
    """Return where all columns are in one table, as it lies or turned."""
    try:
        return find_header(path, tables, names, clock)
    except ColumnMissing:
        lying = [each for table in tables if (each := turn_table(table))]
        if not lying:
            raise
        return find_header(path, lying, names, clock)


def _of_own_clocks(header: Header, clock: str, wanted: Sequence[str], status: Sequence[str]) -> list[Header]:
    """Return a header for each clock that some of a table's columns go by."""
    if len(header.at[clock]) > 1:
        return [header]
    clocks = sorted({*matches(header.names, clock, header.as_written), *clock_places(header)} | {header.at[clock][0]})
    nearest = {name: _nearest(clocks, header.at[name][0]) for name in (*wanted, *status)}
    of_values = list(dict.fromkeys(nearest[name] for name in wanted))
    if len(of_values) == 1:
        same_name = of_values[0] in matches(header.names, clock, header.as_written)
        return [_with_clock(header, clock, of_values[0], header.at)] if same_name else [header]
    return [
        _with_clock(header, clock, place, {name: at for name, at in header.at.items() if nearest.get(name) == place})
        for place in of_values
    ]


def _with_clock(header: Header, clock: str, place: int, at: Mapping[str, tuple[int, ...]]) -> Header:
    return with_units(replace(header, at={**at, clock: (place,)}))


def _nearest(clocks: Sequence[int], place: int) -> int:
    return max((each for each in clocks if each < place), default=min(clocks))


def clock_places(header: Header) -> list[int]:
    """Return which columns of a table are clocks, by their names and by what is in them."""
    rows, several = _first_rows(header), Counter(header.as_written)
    written = header.as_written or header.names
    again = [bool(name) and several[name] > 1 for name in written]
    return [
        index
        for index, name in enumerate(written)
        if again[index] or rank_by_name("time_s", name) is not None
        if may_be_clock(cells := cells_at(rows, index)) and (again[index] or _mostly_distinct(cells))
    ]


def _mostly_distinct(cells: Sequence[Cell]) -> bool:
    """Return whether hardly a time stands twice: what counts hours or runs is no clock of the rows."""
    held = [cell for cell in cells if cell != ""]
    return len(set(held)) > DISTINCT * len(held)


def signal_places(header: Header) -> list[int]:
    """Return which columns of a table hold a signal."""
    clocks = clock_places(header)
    return [index for index in value_places(header, _first_rows(header)) if index not in clocks]


def _first_rows(header: Header) -> list[list[Cell]]:
    after = (
        row for line, row in header.table.rows() if line > header.samples_after and any(cell != "" for cell in row)
    )
    return list(islice(after, LOOKED_AT))


def _in_tables_of_their_own(
    path: Path, tables: Sequence[RawTable], clock: str | None, wanted: Sequence[str], status: Sequence[str]
) -> list[Header]:
    """Return where each column is with a clock of its own table; nothing where one is nowhere."""
    found: dict[object, Header] = {}
    for name in wanted:
        one = _with_its_clock(path, tables, clock, name)
        if one is None:
            return []
        of_table, header = one
        before = found.get(of_table)
        found[of_table] = header if before is None else replace(before, at={**before.at, **header.at})
    return [with_units(replace(each, at={**each.at, **_status_in(each, status)})) for each in found.values()]


def _status_in(header: Header, status: Sequence[str]) -> dict[str, tuple[int, ...]]:
    places = {name: matches(header.names, name, header.as_written) for name in status}
    return {name: (at[0],) for name, at in places.items() if at}


def _with_its_clock(
    path: Path, tables: Sequence[RawTable], clock: str | None, name: str
) -> tuple[object, Header] | None:
    """Return what tells the table that a column is in, and where it is there with its clock; None if none has it."""
    for number, table in enumerate(tables):
        if clock is None:
            continue  # one name alone stands anywhere
        try:
            return number, find_header(path, [table], [clock, name], clock)
        except InputError:
            continue
    for number, table in enumerate(tables):
        if _same(table.sheet, name) and (header := guess_header([table])):
            values = signal_places(header)
            if len(values) == 1 and (found := _by_its_clock(header, clock, name, values[0])):
                return number, found
    for number, table in enumerate(tables):
        if (of_it := table_of_signal(table, name)) and (header := guess_header([of_it])):
            place = matches(header.names, name)
            if place and (found := _by_its_clock(header, clock, name, place[0])):
                return (number, name), found
    return None


def _same(one: str, other: str) -> bool:
    return " ".join(one.split()).casefold() == " ".join(other.split()).casefold()


def _by_its_clock(header: Header, clock: str | None, name: str, place: int) -> Header | None:
    if clock is None:
        return with_units(replace(header, at={name: (place,)}))
    clocks = matches(header.names, clock, header.as_written) or clock_places(header)
    if not clocks:
        return None
    at = {clock: (_nearest(clocks, place),), name: (place,)}
    return with_units(replace(header, at=at, clock=clock))

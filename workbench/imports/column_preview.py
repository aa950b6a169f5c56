"""What is in the columns of a file, for a person who has not said yet what they are: names, values, units, clocks.

The columns are those of the likeliest reading. Where each signal has a table of its own, a sheet, a group or a tag of
an archive with a row a value, the columns are the signals, called as the reader finds them.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from config.errors import InputError
from workbench.imports.cell_units import split_unit, with_any_unit
from workbench.imports.clock_groups import clock_places, signal_places
from workbench.imports.column_names import STATUS, rank_by_name
from workbench.imports.header_search import Header, guess_header
from workbench.imports.number_notation import decimal_sign, is_numeral
from workbench.imports.raw_table import Cell, RawTable
from workbench.imports.turned_tables import signals_in, table_of_signal, turn_table

LOOKED_AT = 200  # rows that are read to say what a column holds
MOST_SHOWN = 5
"""Words of a status that are shown."""
WIDEST_CELL = 24
"""Characters of a cell that are shown."""
GOOD = "192"
"""What OPC calls good, where qualities are numbers."""


@dataclass(frozen=True, slots=True)
class ColumnPreview:
    """A column of a file.

    Attributes:
        name: by which the reader finds it.
        unit: as the file says it, in our spelling; None where it says none that is known.
        cells: the first.
        unknown: what stands in the unit's place and is none that is known.
        clock: the name of the clock that it goes by; "" where only one is there.
    """

    name: str
    unit: str | None
    cells: tuple[Cell, ...]
    unknown: str = ""
    clock: str = ""

    @property
    def numbers(self) -> bool:
        """Whether its cells are numbers, with a unit behind them or none, but for some words."""
        found = [cell for cell in self.cells if cell != ""]
        numbers = sum(isinstance(cell, float) or is_numeral(with_any_unit(cell)[0]) for cell in found)
        return bool(found) and numbers > len(found) / 2

    @property
    def units_behind(self) -> tuple[str, ...]:
        """The units that stand behind its numbers."""
        behind = (split_unit(cell)[1] for cell in self.cells if isinstance(cell, str) and cell)
        return tuple(dict.fromkeys(each for each in behind if each))

    @property
    def status_words(self) -> str:
        """The words by which it says which rows are good; empty of a column that does not."""
        if self.numbers or not STATUS.search(self.name):
            return ""
        return ", ".join(sorted({str(cell) for cell in self.cells if cell != ""})[:MOST_SHOWN])

    @property
    def opc_qualities(self) -> str:
        """The numbers by which it says, as OPC does, which rows are good; empty of a column that does not."""
        held = Counter(show_cell(cell) for cell in self.cells if cell != "")
        if not self.numbers or not STATUS.search(self.name) or 2 * held[GOOD] <= held.total():
            return ""
        return ", ".join(number for number, _ in held.most_common(MOST_SHOWN))


def show_cell(cell: Cell) -> str:
    """Return a cell as it is shown, in one short line."""
    text = f"{cell:.10g}" if isinstance(cell, float) else cell.replace("\n", " ")
    return text if len(text) <= WIDEST_CELL else text[: WIDEST_CELL - 2] + ".."


def find_sign(columns: Sequence[ColumnPreview], separator: str) -> tuple[str, str]:
    """Return the decimal sign that some columns show, and what a person must say where they leave it open."""
    texts = [with_any_unit(cell)[0] for each in columns if each.numbers for cell in each.cells if isinstance(cell, str)]
    try:
        return decimal_sign("", texts, separator), ""
    except InputError as error:
        return ".", error.problem


def read_header(path: Path, tables: Sequence[RawTable]) -> Header:
    """Return the likeliest reading of a file; one that is turned before those that are not.

    Raises:
        InputError: it holds no table.
    """
    lying = [each for table in tables if (each := turn_table(table))]
    header = guess_header(lying) or guess_header(tables)
    if header is None:
        raise InputError(str(path), "holds no table: no two of its first lines have the same columns")
    return header


def columns_of(header: Header) -> list[ColumnPreview]:
    """Return the columns of a table; of one with a row a value, its clocks and its signals."""
    signals = signals_in(header)
    if not signals:
        return _plain(header)
    found = [each for each in _plain(header) if rank_by_name("time_s", each.name) == 0 or STATUS.search(each.name)]
    for signal in signals:
        table = table_of_signal(header.table, signal)
        of_it = guess_header([table]) if table else None
        found += [each for each in _plain(of_it) if each.name == signal] if of_it else []
    return found


def columns_of_all(tables: Sequence[RawTable], first: Header) -> list[ColumnPreview]:
    """Return the columns of the first table, and of the others those of other names.

    A table of one signal is that signal, called as the table is.
    """
    found: list[ColumnPreview] = []
    for table in (first.table, *(each for each in tables if each is not first.table)):
        header = first if table is first.table else guess_header([table])
        if header is None:
            continue
        columns = _plain(header)
        values = signal_places(header)
        if table.sheet and len(values) == 1 and len(tables) > 1:
            signal = header.names[values[0]]
            columns = [replace(each, name=table.sheet) if each.name == signal else each for each in columns]
        taken = {each.name for each in found}
        found += [each for each in columns if each.name not in taken]
    return found


def _plain(header: Header) -> list[ColumnPreview]:
    rows = list(islice(_samples(header), LOOKED_AT))
    clocks = clock_places(header)
    return [
        ColumnPreview(
            name,
            header.units[name][0] if name in header.units else None,
            tuple(row[index] for row in rows if index < len(row)),
            header.unknown.get(name, ""),
            header.names[max((each for each in clocks if each < index), default=clocks[0])] if len(clocks) > 1 else "",
        )
        for index, name in enumerate(header.names)
        if name
    ]


def _samples(header: Header) -> Iterator[list[Cell]]:
    for line, row in header.table.rows():
        if line > header.samples_after and any(cell != "" for cell in row):
            yield row

"""Tables that lie otherwise than a column a signal, turned so: a row a signal, and a row a value.

t;0;0.5;1                        a row a signal: few rows, each a name and then numbers
PV;50;51;52

Tag;Time;Value;Quality           a row a value, as archives keep it: a column of words says whose each row is,
OP;12:00:00;0.61;Good            so that every signal is a table of its own with its own clock
ZT;12:00:00;20.1;Good
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice, zip_longest

from config.errors import InputError
from workbench.imports.cell_kinds import begins_number
from workbench.imports.cell_units import split_unit, unit_named
from workbench.imports.column_names import COUNTER, STATUS, is_called, rank_by_name
from workbench.imports.header_search import Header, guess_header
from workbench.imports.number_notation import is_numeral
from workbench.imports.raw_table import Cell, RawTable

LOOKED_AT = 200
"""Rows by which a table is told to have a row a value."""
ROW_A_SIGNAL = 10
"""Cells of a row, from which on one that begins with a name is taken for a signal."""
MOST_ROWS_OF_SIGNALS = 60  # more rows are samples
MOST_SIGNALS = 20
"""Words of a column that says whose a value is, which a preview lists."""
UNIT = r"^(unit|einheit|unit[ée]s?|unidad|unit[àa]|uom|eu|engineering units?|jednostka)s?$"
VALUE = r"value|wert|valeur|valor|warto"


def turn_table(table: RawTable) -> RawTable | None:
    """Return a table with a row a signal, turned; None if it is none."""
    try:
        rows = [
            cells for _, cells in islice(table.rows(), MOST_ROWS_OF_SIGNALS + 1) if any(cell != "" for cell in cells)
        ]
    except InputError:
        return None
    signals = [cells for cells in rows if len(cells) > ROW_A_SIGNAL]
    if not 1 < len(rows) <= MOST_ROWS_OF_SIGNALS or len(signals) < 2 or not all(map(_is_signal, signals)):
        return None
    columns = list(zip_longest(*signals, fillvalue=""))
    return replace(
        table,
        what=f"{table.what}, a row a signal",
        place="value",
        rows=lambda: enumerate(map(list, columns), start=1),
        length=len(columns),
    )


def _is_signal(cells: Sequence[Cell]) -> bool:
    name, *values = cells
    numbers = [cell for cell in values if cell != ""]
    return name != "" and not begins_number(name) and 2 * sum(map(begins_number, numbers)) > len(numbers) > 0


def signals_in(header: Header) -> list[str]:
    """Return the signals that a column of a table with a row a value names; none of another table."""
    rows = [
        cells
        for line, cells in islice(header.table.rows(), header.samples_after + LOOKED_AT)
        if line > header.samples_after
    ]
    if len(value_places(header, rows)) != 1:
        return []
    for index, name in enumerate(header.names):
        cells = [cell for cell in cells_at(rows, index) if cell != ""]
        if any(map(begins_number, cells)) or STATUS.search(name):
            continue
        held = list(dict.fromkeys(map(str, cells)))
        if len(held) == 1 < len(cells):  # a signal after the other, each in a block
            rest = islice(header.table.rows(), header.samples_after, None)
            held = list(dict.fromkeys(str(row[index]) for _, row in rest if index < len(row) and row[index] != ""))
        if 1 < len(held) <= min(MOST_SIGNALS, len(cells) // 4):
            return [each for each in held if not each.startswith("$")]
    return []


def table_of_signal(table: RawTable, signal: str) -> RawTable | None:
    """Return the rows of one signal of a table with a row a value; None if no column of words holds its name.

    The column of its values is named as the signal is.
    """
    header = guess_header([table])
    if header is None or not header.line:
        return None
    rows = list(_rows_of(header, signal))
    if len(rows) < 2:
        return None
    values = value_places(header, [cells for _, cells in rows[:LOOKED_AT]])
    if len(values) != 1:
        return None
    unit = next((index for index, name in enumerate(header.names) if is_called(UNIT, name)), None)
    if unit is not None:
        rows = [(line, _with_its_unit(cells, values[0], unit)) for line, cells in rows]
    names = [signal if index == values[0] else name for index, name in enumerate(header.names)]
    first: list[tuple[int, list[Cell]]] = [(header.line, list(names))]
    return replace(table, what=f"{table.what}, rows of {signal!r}", rows=lambda: iter(first + rows), length=len(rows))


def _with_its_unit(cells: Sequence[Cell], place: int, unit: int) -> list[Cell]:
    """Return a row with the unit that stands in a column of its own behind the value."""
    found = list(cells)
    said = str(cells[unit]) if unit < len(cells) else ""
    if unit_named(said) and place < len(cells) and cells[place] != "":
        value = cells[place]
        found[place] = f"{value!r} {said}" if isinstance(value, float) else f"{value} {said}"
    return found


def _rows_of(header: Header, signal: str) -> Iterator[tuple[int, list[Cell]]]:
    for line, cells in header.table.rows():
        if line > header.samples_after and any(cell == signal for cell in cells):
            yield line, cells


def value_places(header: Header, rows: Sequence[Sequence[Cell]]) -> list[int]:
    """Return the columns of numbers that may be signals, neither a clock's, a quality's nor the rows'.

    Of several, the one that is called a value, else those that change.
    """
    found = []
    for index, name in enumerate(header.names):
        cells = [cell for cell in cells_at(rows, index) if cell != ""]
        numbers = sum(isinstance(cell, float) or is_numeral(split_unit(cell)[0]) for cell in cells)
        other = STATUS.search(name) or COUNTER.search(name) or rank_by_name("time_s", name) is not None
        if cells and 2 * numbers > len(cells) and not other:
            found.append(index)
    called = [index for index in found if is_called(VALUE, header.names[index])]
    changing = [index for index in found if len(set(cells_at(rows, index))) > 1]
    return called if len(called) == 1 else changing if len(found) > 1 else found


def cells_at(rows: Sequence[Sequence[Cell]], index: int) -> list[Cell]:
    """Return a column of some rows, as far as they go."""
    return [row[index] for row in rows if index < len(row)]

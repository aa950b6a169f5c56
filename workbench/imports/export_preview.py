"""What a file holds, and the words that may read it: looked at by the code that reads it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from config.results.block import Block, Table, as_text
from workbench.imports.cell_kinds import numbers_of
from workbench.imports.cell_units import with_any_unit
from workbench.imports.column_preview import (
    ColumnPreview,
    columns_of,
    columns_of_all,
    find_sign,
    read_header,
    show_cell,
)
from workbench.imports.column_proposal import Proposal, is_clock, proposal, quote_word
from workbench.imports.control_loop import LoopColumn, LoopColumns, loops_of
from workbench.imports.file_kind import raw_tables
from workbench.imports.header_search import SHOWN, Header
from workbench.imports.raw_table import RawTable

FIRST_CELLS = 3
"""Cells of a column that are shown."""
MOST_TABLES = 5


@dataclass(frozen=True, slots=True)
class ExportPreview:
    """What a file holds.

    Attributes:
        what: how it was taken.
        header: where its columns are named, or that they are not.
        columns: in their order.
        proposal: how it may be read, and what a person must say; nothing of a loop's without a stem.
        loops: the loops that it is of.
    """

    what: str
    header: str
    columns: tuple[ColumnPreview, ...]
    proposal: Proposal
    loops: tuple[LoopColumns, ...] = ()

    @property
    def words(self) -> tuple[str, ...]:
        """What would read it, words of the command line."""
        return (*self.proposal.mapping.words, *self.proposal.blanks)

    def summary(self) -> str:
        """Say the columns, the proposal and what is open."""
        return as_text(self._blocks())

    def _blocks(self) -> list[Block]:
        rows = [
            (each.name, each.unit or "", *(show_cell(cell) for cell in (*each.cells, "", "", "")[:FIRST_CELLS]))
            for each in self.columns
        ]
        proposed = " ".join(map(quote_word, self.words))
        return [
            f"{self.what}; {self.header}",
            Table(("column", "unit", "row 1", "row 2", "row 3"), rows),
            *self.proposal.open,
            f"proposed, check it: {proposed}" if proposed else "nothing is proposed",
        ]


def preview(path: Path, sheet: str | None = None) -> ExportPreview:
    """Return what a file holds, and the words of a command line that may read it.

    Raises:
        InputError: it cannot be read or holds no table.
    """
    tables = raw_tables(path, sheet)
    header = read_header(path, tables)
    columns = columns_of(header)
    besides = _besides(header.table, tables)
    proposed = proposal(columns, header.table.separator)
    if header.table.sheet and not proposed.reads:
        of_all = columns_of_all(tables, header)
        wider = proposal(of_all, header.table.separator)
        if wider.reads:
            columns, proposed, besides = of_all, wider, []
    decimal, is_open = find_sign(columns, header.table.separator)
    signals = [each for each in columns if each.numbers and not is_clock(each)]
    told = (loops_of([_of_loop(each, sign) for each in signals]) for sign in (",." if is_open else decimal))
    loops = tuple(next(filter(None, told), ()))
    if loops and not any(each.position for each in loops):
        proposed = Proposal(open=tuple(_no_stem(path, each) for each in loops))
    proposed = replace(proposed, open=(*proposed.open, *besides))
    return ExportPreview(_what(header, tables), _place(header), tuple(columns), proposed, loops)


def _what(header: Header, tables: Sequence[RawTable]) -> str:
    if not header.table.sheet or len(tables) < 2:
        return header.table.what
    return f"{header.table.what} of {', '.join(repr(each) for each in dict.fromkeys(each.sheet for each in tables))}"


def _place(header: Header) -> str:
    if header.line:
        return f"{header.table.place} {header.line} names the columns{header.lasts}"
    return "no line names the columns" if header.names[0] == "#1" else "its columns"


def _of_loop(column: ColumnPreview, decimal: str) -> LoopColumn:
    """Return a column as a loop's are recognised."""
    behind = (with_any_unit(cell)[1] for cell in column.cells if isinstance(cell, str))
    unit = column.unit or next(filter(None, behind), "") or column.unknown
    return LoopColumn(column.name, unit, numbers_of(column.cells, decimal))


def _no_stem(path: Path, loop: LoopColumns) -> str:
    """Return what to say of a loop whose stem is not measured."""
    return (
        f"{loop.because}: this is a loop, not a stem, and {loop.process_value!r} is compared with nothing; "
        f"`positioner loop {path}` says from it whether the valve sticks; a model needs the stem's own position (ZT, "
        "travel, feedback) beside the command"
    )


def _besides(shown: RawTable, tables: Sequence[RawTable]) -> list[str]:
    """Return what the other tables of a measurement file hold, which are of other times than the one that is shown."""
    others = [each for each in tables if each is not shown and each.length and each.place == "row"]
    named = [f"{each.what}: {', '.join(map(str, next(each.rows())[1][:SHOWN]))}" for each in others[:MOST_TABLES]]
    more = [f"and {len(others) - MOST_TABLES} more"] if len(others) > MOST_TABLES else []
    return ["of other times, not shown: " + each for each in (*named, *more)]

"""The samples of the columns that are wanted, as cells: no blank rows, no header again, no footer, no torn last row."""

from array import array
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from config.errors import InputError
from workbench.imports.cell_kinds import begins_number
from workbench.imports.header_search import Header
from workbench.imports.raw_table import Cell

Progress = Callable[[str, float], None]
ROW_LIMIT = 3_000_000
"""Of an export: a minute of reading, and some hundred bytes of memory a cell."""
TOLD_EVERY = 50_000
"""Rows."""
FOOTER = 20
"""Rows without a time that may end a file: averages, signatures."""


@dataclass(frozen=True, slots=True)
class Samples:
    """The columns that are wanted, as cells, by their names; where each row stands, and what was left out."""

    header: Header
    cells: dict[str, list[Cell]]
    lines: "array[int]"
    notes: dict[str, str]

    def keep_rows(self, rows: Sequence[int]) -> "Samples":
        """Return some of the rows."""
        cells = {name: [column[row] for row in rows] for name, column in self.cells.items()}
        return Samples(self.header, cells, array("q", (self.lines[row] for row in rows)), self.notes)


def collect_samples(path: Path, header: Header, clock: str | None, tell: Progress) -> Samples:
    """Return the samples under a header, by a clock's column where there is one.

    Raises:
        InputError: more rows than are read, none at all, or a row wider than the header.
    """
    _require_few(path, header.table.length)
    cells: dict[str, list[Cell]] = {name: [] for name in header.at}
    lines = array("q")
    notes: Counter[str] = Counter()
    if header.samples_after > header.line > 0:
        notes["rows under the header that are no samples"] = header.samples_after - header.line
    short: list[int] = []
    for line, row in _rows(path, header, notes):
        if len(row) <= max(max(places) for places in header.at.values()):
            short.append(line)
        for name, places in header.at.items():
            cells[name].append(_join_cells(row, places))
        lines.append(line)
        if not len(lines) % TOLD_EVERY:
            _require_few(path, len(lines))
            tell(f"reading {path.name}: {len(lines)} rows", len(lines) / max(header.table.length, len(lines)))
    if short and not header.table.ended and short[-1] == lines[-1]:
        for column in cells.values():
            column.pop()
        lines.pop()
        short.pop()
        notes["torn: the last row is not whole and was left out"] = 1
    if short:
        notes["rows that end early"] = len(short)
    found = Samples(header, cells, lines, {key: str(count) for key, count in notes.items()})
    found = found if clock is None else _without_footer(_of_its_rows(found), clock)
    if not found.lines:
        raise InputError(str(path), f"holds no samples under the names of {header.table.place} {header.line}")
    return found


def _require_few(path: Path, rows: int) -> None:
    if rows > ROW_LIMIT:
        raise InputError(
            str(path),
            f"has {rows / 1e6:.3g} million rows, and an export is read up to {ROW_LIMIT / 1e6:g} million: export a "
            "shorter stretch, or split the file",
        )


def _rows(path: Path, header: Header, notes: Counter[str]) -> Iterator[tuple[int, list[Cell]]]:
    again = list(header.as_written)
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


def _join_cells(row: Sequence[Cell], places: Sequence[int]) -> Cell:
    found = [row[place] if place < len(row) else "" for place in places]
    return found[0] if len(found) == 1 else " ".join(map(_midnight_cut, found)).strip()


def _midnight_cut(cell: Cell) -> str:
    """Return a cell's words; a date of a workbook without its midnight."""
    return str(cell).removesuffix("T00:00:00")


def _of_its_rows(samples: Samples) -> Samples:
    """Return the samples without rows in which neither the clock nor its columns hold anything: others' are longer."""
    columns = list(samples.cells.values())
    empty = [row for row in range(len(samples.lines)) if all(column[row] == "" for column in columns)]
    if not empty:
        return samples
    left_out = set(empty)
    return samples.keep_rows([row for row in range(len(samples.lines)) if row not in left_out])


def _without_footer(samples: Samples, clock: str) -> Samples:
    """Return the samples without rows at the end that have no time and follow one that has."""
    cells = samples.cells[clock]
    kept = len(cells)
    while kept > 1 and not begins_number(cells[kept - 1]) and len(cells) - kept < FOOTER:
        if not any(begins_number(cell) for cell in cells[max(kept - FOOTER - 1, 0) : kept - 1]):
            break
        kept -= 1
    if kept == len(cells):
        return samples
    samples.notes["rows without a time at the end, left out"] = str(len(cells) - kept)
    return samples.keep_rows(range(kept))

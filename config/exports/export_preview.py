"""What a file holds, for a person who has not said yet what its columns are: names, first values, units, a proposal.

The proposal goes by what columns are commonly called and by what is in them. It is printed, never used.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

from config.drive import KINDS, VALVE
from config.errors import InputError
from config.exports.column_names import COMMON, SETPOINT, STATUS, is_called, rank_by_name
from config.exports.control_loop import LoopColumn, LoopColumns, loops_of
from config.exports.export_units import SHARES, UNITS, allowed_units, ending_of, unit_named
from config.exports.file_kind import raw_tables
from config.exports.header_search import SHOWN, Header, begins_number, guess_header
from config.exports.number_notation import decimal_sign, is_numeral, number
from config.exports.raw_table import Cell, RawTable
from config.exports.time_stamps import clock_unit, proposed_formats
from config.results.block import Block, Table, as_text

LOOKED_AT = 200
FIRST = 3
MOST_SIGNALS = 20
MOST_TABLES = 5
WIDEST = 24
STAMP = r"\d{4}-\d\d-\d\d"
GOOD = "192"
"""What OPC calls good, where qualities are numbers."""


@dataclass(frozen=True, slots=True)
class ColumnPreview:
    """A column of a file: its name, the unit the file says, and its first cells."""

    name: str
    unit: str | None
    cells: tuple[Cell, ...]

    @property
    def numbers(self) -> bool:
        """Whether its cells are numbers, but for some words."""
        found = [cell for cell in self.cells if cell != ""]
        return bool(found) and sum(isinstance(cell, float) or is_numeral(cell) for cell in found) > len(found) / 2

    @property
    def status_words(self) -> str:
        """The words by which it says which rows are good; empty of a column that does not."""
        if self.numbers or not STATUS.search(self.name):
            return ""
        return ", ".join(sorted({str(cell) for cell in self.cells if cell != ""})[:5])

    @property
    def opc_qualities(self) -> str:
        """The numbers by which it says, as OPC does, which rows are good; empty of a column that does not."""
        held = Counter(_short(cell) for cell in self.cells if cell != "")
        if not self.numbers or not STATUS.search(self.name) or 2 * held[GOOD] <= held.total():
            return ""
        return ", ".join(number for number, _ in held.most_common(5))


@dataclass(frozen=True, slots=True)
class ExportPreview:
    """What a file holds.

    Attributes:
        what: how it was taken.
        header: where its columns are named, or that they are not.
        columns: in their order.
        words: what would read it, words of the command line; none of a loop's without a stem.
        open: what a person must say or look at.
        loops: the loops that it is of.
    """

    what: str
    header: str
    columns: tuple[ColumnPreview, ...]
    words: tuple[str, ...]
    open: tuple[str, ...]
    loops: tuple[LoopColumns, ...] = ()

    def summary(self) -> str:
        """Say the columns, the proposal and what is open."""
        return as_text(self._blocks())

    def _blocks(self) -> list[Block]:
        rows = [
            (each.name, each.unit or "", *(_short(cell) for cell in (*each.cells, "", "", "")[:FIRST]))
            for each in self.columns
        ]
        proposed = " ".join(map(_quoted, self.words))
        return [
            f"{self.what}; {self.header}",
            Table(("column", "unit", "first", "values", ""), rows),
            *self.open,
            f"proposed, look at it: {proposed}" if proposed else "nothing is proposed",
        ]


def preview(path: Path, sheet: str | None = None) -> ExportPreview:
    """Return what a file holds, and the words of a command line that may read it.

    Raises:
        InputError: it cannot be read or holds no table.
    """
    tables = raw_tables(path, sheet)
    header = guess_header(tables)
    if header is None:
        raise InputError(str(path), "holds no table: no two of its first lines have the same columns")
    after = (
        row for line, row in header.table.rows() if line > header.samples_after and any(cell != "" for cell in row)
    )
    rows = list(islice(after, LOOKED_AT))
    named = [(index, name) for index, name in enumerate(header.names) if name]
    columns = tuple(
        ColumnPreview(
            name,
            header.units[name][0] if name in header.units else None,
            tuple(row[index] for row in rows if index < len(row)),
        )
        for index, name in named
    )
    what = header.table.what
    if header.table.sheet and len(tables) > 1:
        what += f" of {', '.join(repr(each) for each in dict.fromkeys(each.sheet for each in tables))}"
    place = f"{header.table.place} {header.line} names the columns"
    if not header.line:
        place = "no line names the columns" if header.names[0] == "#1" else "its columns"
    loops = tuple(loops_of([_of_loop(each, header) for each in columns if each.numbers]))
    words, open_ = _proposal(columns, header)
    if loops and not any(each.position for each in loops):
        words, open_ = (), tuple(_no_stem(each) for each in loops)
    return ExportPreview(what, place, columns, words, (*open_, *_besides(header.table, tables)), loops)


def _of_loop(column: ColumnPreview, header: Header) -> LoopColumn:
    """Return a column as a loop's are recognised."""
    texts = [cell for cell in column.cells if isinstance(cell, str)]
    try:
        decimal = decimal_sign("", texts, header.table.separator)
    except InputError:  # a person must say, and is told so
        decimal = "."
    read = [cell if isinstance(cell, float) else number(cell, decimal) for cell in column.cells]
    values = np.array([np.nan if each is None else each for each in read])
    return LoopColumn(column.name, column.unit or header.unknown.get(column.name, ""), values)


def _no_stem(loop: LoopColumns) -> str:
    """Return what to say of a loop whose stem is not measured."""
    return (
        f"{loop.because}: {loop.process_value!r} is what a loop controls and no stem's position, and nothing is "
        "compared with it; export the stem's own position (ZT, travel, feedback) beside the command"
    )


def _besides(shown: RawTable, tables: Sequence[RawTable]) -> list[str]:
    """Return what the other tables of a measurement file hold, which are of other times than the one that is shown."""
    others = [each for each in tables if each is not shown and each.length and each.place == "row"]
    named = [f"{each.what}: {', '.join(map(str, next(each.rows())[1][:SHOWN]))}" for each in others[:MOST_TABLES]]
    more = [f"and {len(others) - MOST_TABLES} more"] if len(others) > MOST_TABLES else []
    return ["of other times, not shown: " + each for each in (*named, *more)]


def _proposal(columns: Sequence[ColumnPreview], header: Header) -> tuple[tuple[str, ...], tuple[str, ...]]:
    words: list[str] = []
    open_: list[str] = []
    left = list(columns)
    of_drive = _of_drive(columns)
    for ours in ("time_s", *of_drive) if of_drive else COMMON:
        chosen = of_drive.get(ours) or _likeliest(ours, left)
        if chosen is None and ours == "time_s":
            chosen = next((each for each in left if _most_are(each.cells, STAMP)), None)
        if chosen is None:
            open_.append(f"{ours} is open: no column is called like it; --column {ours}=NAME:UNIT says which is")
            continue
        left.remove(chosen)
        name = "reference_m" if ours == "command_pa" and _is_setpoint(chosen) else ours
        if ours == "time_s":
            chosen = _whole_clock(chosen, left)
        unit, doubt = _unit_of(name, chosen)
        if doubt and (unknown := header.unknown.get(chosen.name)):
            doubt = [f"the unit of {chosen.name!r} is {unknown!r} by the file, none that is known; {unit} is a guess"]
        words += ["--column", f"{name}={chosen.name}{unit}"]
        open_ += doubt
        if ours == "time_s" and not chosen.numbers:
            words += _time_words(chosen, open_)
    words += [word for each in left if each.opc_qualities for word in ("--status", f"{each.name}={GOOD}")]
    open_ += _doubts(columns, left, header.table.separator)
    if any(word.endswith(":%") and word.startswith("position") for word in words):
        words += ["--stroke-m", "M"]
    return tuple(words), tuple(open_)


def _of_drive(columns: Sequence[ColumnPreview]) -> dict[str, ColumnPreview]:
    """Return which columns are the travel and the command of a drive, by the units they are in; none of a valve's."""
    if any(each.unit in UNITS["_pa"] for each in columns):
        return {}
    for kind in KINDS.values():
        for moved in ("position_m", "velocity_m_per_s"):
            names = [kind.own(moved), kind.own("command_pa")]
            found = [next((each for each in columns if _is_in(name, each)), None) for name in names]
            if kind is not VALVE and all(found):
                return {name: each for name, each in zip(names, found, strict=True) if each}
    return {}


def _is_in(ours: str, column: ColumnPreview) -> bool:
    """Whether the file says that a column is in one of the units of ours; mA may be a share of a range."""
    return column.numbers and column.unit in UNITS[ending_of(ours)] and column.unit not in SHARES


def _doubts(columns: Sequence[ColumnPreview], left: Sequence[ColumnPreview], separator: str) -> Iterator[str]:
    """Yield what a person must look at beyond the columns that were chosen."""
    for each in left:
        if held := each.status_words:
            (often, _), *_ = Counter(cell for cell in each.cells if cell != "").most_common()
            keeps = f"--status {_quoted(f'{each.name}={often}')} keeps the rows of that word alone"
            yield f"{each.name!r} holds {held}: {keeps}, if it is the good one"
        if held := each.opc_qualities:
            yield f"{each.name!r} holds {held}: of OPC's qualities {GOOD} is good, the rows of it alone are kept"
    if said := _row_a_value(columns):
        yield said
    texts = [cell for each in columns if each.numbers for cell in each.cells if isinstance(cell, str)]
    try:
        decimal_sign("", texts, separator)
    except InputError as error:
        yield error.problem


def _row_a_value(columns: Sequence[ColumnPreview]) -> str | None:
    """Return what to say of a table in which a column of few words, in turn, says whose the only number is.

    A quality that is a number says how good it is, and is none.
    """
    numbers = [each for each in columns if each.numbers and _rank("time_s", each) is None]
    if len([each for each in numbers if not STATUS.search(each.name)]) != 1:
        return None
    for each in columns:
        held = list(dict.fromkeys(map(str, each.cells)))
        words = not each.numbers and not STATUS.search(each.name) and not any(map(begins_number, held))
        if words and 1 < len(held) <= min(MOST_SIGNALS, len(each.cells) // 4):
            return (
                f"{each.name!r} holds {', '.join(held[:5])}: a row a value; turn it into a column a signal first, "
                f"as pandas' DataFrame.pivot(columns={each.name!r}) does"
            )
    return None


def _whole_clock(clock: ColumnPreview, left: list[ColumnPreview]) -> ColumnPreview:
    """Return the clock, joined with the time of day that is then no longer left, if it needs one."""
    if (joined := _with_time_of_day(clock, left)) is None:
        return clock
    left.remove(joined)
    cells = tuple(f"{day} {time}" for day, time in zip(clock.cells, joined.cells, strict=True))
    return ColumnPreview(f"{clock.name}+{joined.name}", None, cells)


def _with_time_of_day(day: ColumnPreview, others: Sequence[ColumnPreview]) -> ColumnPreview | None:
    """Return the column of the time of day that goes with one of days; None if it needs none."""
    if day.numbers or any(":" in str(cell) for cell in day.cells):
        return None
    times = (each for each in others if _most_are(each.cells, r"\d{1,2}:\d\d"))
    return next((each for each in times if len(each.cells) == len(day.cells)), None)


def _most_are(cells: Sequence[Cell], pattern: str) -> bool:
    return 2 * sum(re.match(pattern, str(cell)) is not None for cell in cells) > len(cells)


def _likeliest(ours: str, columns: Sequence[ColumnPreview]) -> ColumnPreview | None:
    """Return the column that is called most like ours, the first of several; None if none is."""
    ranked = [(rank, each) for each in columns if (rank := _rank(ours, each)) is not None]
    return min(ranked, key=lambda each: each[0])[1] if ranked else None


def _rank(ours: str, column: ColumnPreview) -> int | None:
    """Return how surely a column is ours by its name, 0 best, None if it is not."""
    rank = rank_by_name(ours, column.name)
    if rank is None or STATUS.search(column.name):
        return None
    if ours == "time_s":
        return rank if any(begins_number(cell) and cell != "" for cell in column.cells) else None
    if not column.numbers or not (column.unit is None or column.unit in allowed_units(ending_of(ours))):
        return None
    # The set point of a position is none, unless there is no other.
    return rank if ours != "position_m" or not is_called(SETPOINT, column.name) else rank + len(COMMON[ours])


def _is_setpoint(column: ColumnPreview) -> bool:
    """Whether a column taken for the command is the set point of a valve behind its own positioner."""
    return _rank("command_pa", column) == COMMON["command_pa"].index(SETPOINT) and column.unit not in UNITS["_pa"]


def _unit_of(ours: str, column: ColumnPreview) -> tuple[str, list[str]]:
    """Return `:UNIT` and what is open about it; nothing where the file says it or SI stands in the name."""
    if column.unit is not None:
        return f":{column.unit}", []
    if column.name == ours or not column.numbers:
        return "", []
    behind = [str(cell).lstrip("+-0123456789.,eE ") for cell in column.cells if isinstance(cell, str) and cell]
    if behind and (unit := unit_named(behind[0])):
        return f":{unit}", []
    if unit := _at_the_end(ours, column.name):
        return f":{unit}", [f"the unit of {column.name!r} is taken from its name: {unit}"]
    return (
        _unit_of_clock(column) if ours == "time_s" else (":%", [f"the unit of {column.name!r} is open: % is a guess"])
    )


def _unit_of_clock(column: ColumnPreview) -> tuple[str, list[str]]:
    if clock := clock_unit(np.array([float(cell) for cell in column.cells if _is_plain(cell)])):
        return f":{clock[0]}", [f"{column.name!r} is taken for {clock[1]}"]
    return "", [f"the unit of {column.name!r} is open: s is taken; :ms, :min, :d are others"]


def _is_plain(cell: Cell) -> bool:
    return isinstance(cell, float) or re.fullmatch(r"\d+(\.\d+)?", cell) is not None


def _at_the_end(ours: str, name: str) -> str | None:
    """Return the unit in which a name ends, as in stem_mm, Hub.Prozent or Travel mm; None if it does not."""
    *before, ending = re.split(r"[_.\s]+", name)
    unit = unit_named(ending) if before else None
    # `p_in` is an input, and no inch.
    return unit if unit in allowed_units(ending_of(ours)) and unit != "in" else None


def _time_words(column: ColumnPreview, open_: list[str]) -> list[str]:
    texts = [str(cell) for cell in column.cells if cell != "" and begins_number(cell)]
    if not texts or all(re.match(STAMP, text) for text in texts):
        return []
    formats = proposed_formats(texts)
    if not formats:
        open_.append(f"how {texts[0]!r} is to be read is open: --time-format")
        return []
    if len(formats) > 1:
        open_.append(f"{texts[0]!r} may be read as {' or '.join(formats)}: the first is proposed")
    return ["--time-format", formats[0]]


def _short(cell: Cell) -> str:
    text = f"{cell:.10g}" if isinstance(cell, float) else cell.replace("\n", " ")
    return text if len(text) <= WIDEST else text[: WIDEST - 2] + ".."


def _quoted(word: str) -> str:
    plain = " ".join(word.split())
    return plain if re.fullmatch(r"[\w=:.%+/@,#-]+", plain) else f'"{plain}"'

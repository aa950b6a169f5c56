"""How a file may be read, proposed by what its columns are commonly called and by what is in them.

It is shown, never used: a person looks at it first.
"""

import re
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from math import inf

import numpy as np
import numpy.typing as npt

from config.drive import KINDS, VALVE
from workbench.imports.cell_kinds import begins_number, may_be_clock, numbers_of
from workbench.imports.cell_units import SHARES, UNITS, ending_of, list_allowed_units, unit_named
from workbench.imports.column_clock import digits_format, time_base
from workbench.imports.column_mapping import RANGE_PA
from workbench.imports.column_names import COMMON, COUNTER, SETPOINT, STATUS, is_called, rank_by_name
from workbench.imports.column_preview import GOOD, ColumnPreview, find_sign
from workbench.imports.export_mapping import ExportMapping
from workbench.imports.raw_table import Cell
from workbench.imports.time_stamps import duration_s, propose_formats

Array = npt.NDArray[np.float64]
STAMP = r"\d{4}-\d\d-\d\d"
VOLTS = (("1-5V", 0.9, 5.1), ("0-10V", -0.2, 10.3), ("0-5V", -0.1, 5.1), ("2-10V", 1.9, 10.2))
"""Ranges of a signal in volts, by the least and the greatest of it."""
ALIKE_SPAN_SHARE = 0.1
"""Of a span: two clocks of the same rows go on alike."""
LEAST_PER_CENT, MOST_SHARE = 3.0, 130.0
"""Between which the greatest of some numbers in % lies: below are shares of 1, or bar."""


@dataclass(frozen=True, slots=True)
class Proposal:
    """How a file may be read, the options that a person must fill in, and what they must say or look at."""

    mapping: ExportMapping = field(default_factory=ExportMapping)
    blanks: tuple[str, ...] = ()
    open: tuple[str, ...] = ()

    @property
    def reads(self) -> bool:
        """Whether it names a position and what is asked of it."""
        return len(self.mapping.theirs.keys() - {"time_s"}) > 1


def proposal(columns: Sequence[ColumnPreview], separator: str) -> Proposal:
    """Return how a file may be read."""
    mapped: list[str] = []
    blanks: list[str] = []
    open_: list[str] = []
    time_format = None
    left = list(columns)
    decimal, sign_open = find_sign(columns, separator)
    of_drive = _of_drive(columns)
    for ours in ("time_s", *of_drive) if of_drive else COMMON:
        chosen = of_drive.get(ours) or (_clock(left) if ours == "time_s" else _likeliest(ours, left))
        if chosen is None:
            open_.append(_not_called(ours))
            blanks += ["--period-s", "S"] if ours == "time_s" else []
            continue
        left.remove(chosen)
        name = "reference_m" if ours == "command_pa" and _is_setpoint(chosen) else ours
        if ours == "time_s":
            chosen = _whole_clock(chosen, left)
        unit, doubt = _unit_of(name, chosen, decimal)
        if chosen.unknown:
            is_open, said = f"{chosen.name!r} is open", f"{chosen.name!r} is {chosen.unknown!r} by the file, none known"
            doubt = [each.replace(is_open, said) for each in doubt]
        mapped.append(f"{name}={chosen.name}{unit}")
        open_ += doubt
        if ours == "time_s" and not chosen.numbers:
            time_format = _time_format(chosen, open_)
    status = tuple(f"{each.name}={GOOD}" for each in left if each.opc_qualities)
    open_ += [*_doubts(left), *([sign_open] if sign_open else [])]
    blanks += _shares(mapped, open_)
    mapping = ExportMapping(column=tuple(mapped), time_format=time_format, status=status)
    return Proposal(mapping, tuple(blanks), tuple(open_))


def _not_called(ours: str) -> str:
    if ours == "time_s":
        return "time_s is open: no column is a time; --period-s S says how far its rows lie apart, or time_s=NAME:UNIT"
    return f"{ours} is open: no column is called like it; --column {ours}=NAME:UNIT says which is"


def _clock(columns: Sequence[ColumnPreview]) -> ColumnPreview | None:
    """Return the column that is the time: called so and rising, or called so, or rising; the stem's own of several."""
    rising = [each for each in columns if may_be_clock(each.cells)]
    ranked = [each for each in columns if _rank("time_s", each) is not None]
    named = [each for each in ranked if each in rising] or ranked
    others = [each for each in columns if each not in named]
    asked, position = (_likeliest(ours, others) for ours in ("command_pa", "position_m"))
    if position and asked and position.clock != asked.clock:
        named = [each for each in columns if each.name == position.clock]
    if named:
        return _finer(min(named, key=lambda each: _rank("time_s", each) or 0), named)
    return next((each for each in rising if each.unit in UNITS["_s"] or _may_be_unnamed(each)), None)


def _may_be_unnamed(column: ColumnPreview) -> bool:
    """Whether a column that rises may be the time, though it is called like nothing."""
    counts = column.numbers and COUNTER.search(column.name)
    return column.unit is None and not counts and not _is_ours(column)


def _is_ours(column: ColumnPreview) -> bool:
    return any(_rank(ours, column) is not None for ours in ("position_m", "command_pa"))


def _cut(clock: ColumnPreview) -> bool:
    """Whether stamps stand several times: fractions of seconds were cut off."""
    return not clock.numbers and ":" in str(clock.cells[0]) and len(set(clock.cells)) < 0.9 * len(clock.cells)


def _finer(clock: ColumnPreview, others: Sequence[ColumnPreview]) -> ColumnPreview:
    """Return another clock of the same span where the fractions of this one were cut off."""
    if not _cut(clock):
        return clock
    span_s = _span_s(clock)
    finer = (each for each in others if may_be_clock(each.cells) and not _cut(each))
    return next((each for each in finer if abs(_span_s(each) - span_s) < ALIKE_SPAN_SHARE * span_s), clock)


def _span_s(clock: ColumnPreview) -> float:
    """Return how long the first rows of a clock last, s; infinite where that is not told."""
    cells = [cell for cell in clock.cells if cell != ""]
    for decimal in ".," if clock.numbers else "":
        values = numbers_of(cells, decimal)
        if np.isfinite(values).all():
            base = time_base(values)
            return abs(float(values[-1] - values[0])) * UNITS["_s"][base.unit if base else clock.unit or "s"]
    lasts_s = duration_s([str(cell) for cell in cells])
    return inf if lasts_s is None else lasts_s


def _shares(mapped: Sequence[str], open_: list[str]) -> list[str]:
    """Return the words, to be filled in, that say what 100 % of a position is, and 0 and 100 % of a pressure."""
    found: list[str] = []
    units = {word.partition("=")[0]: word.rpartition(":")[2].removeprefix("-") for word in mapped}
    if units.get("position_m") in SHARES or units.get("reference_m") in SHARES:
        found += ["--stroke-m", "M"]
    if units.get("command_pa") in SHARES:
        found += ["--range-pa", "AT0", "AT100"]
        low, high = (f"{each * 1e-5:g}" for each in RANGE_PA)
        open_.append(
            f"the pressures of 0 % and 100 % of command_pa are open: {low} and {high} bar are usual, 20e3 100e3"
        )
    return found


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
    return column.unit in UNITS[ending_of(ours)] and column.unit not in SHARES and column.numbers


def _doubts(left: Sequence[ColumnPreview]) -> Iterator[str]:
    """Yield what a person must look at beyond the columns that were chosen."""
    for each in left:
        if held := each.status_words:
            (often, _), *_ = Counter(cell for cell in each.cells if cell != "").most_common()
            keeps = f"--status {quote_word(f'{each.name}={often}')} keeps only rows with {often}, if that means good"
            yield f"{each.name!r} holds {held}: {keeps}"
        if held := each.opc_qualities:
            yield f"{each.name!r} holds {held}: of OPC's qualities {GOOD} means good; only its rows are kept"


def _whole_clock(clock: ColumnPreview, left: list[ColumnPreview]) -> ColumnPreview:
    """Return the clock, joined with the time of day that is then no longer left, if it needs one."""
    if (joined := _with_time_of_day(clock, left)) is None:
        return clock
    left.remove(joined)
    cells = tuple(f"{day} {time}" for day, time in zip(clock.cells, joined.cells, strict=True))
    return replace(clock, name=f"{clock.name}+{joined.name}", unit=None, cells=cells)


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
    if (
        is_clock(column)
        or not column.numbers
        or not (column.unit is None or column.unit in list_allowed_units(ending_of(ours)))
    ):
        return None
    # The set point of a position is none, unless there is no other.
    return rank if ours != "position_m" or not is_called(SETPOINT, column.name) else rank + len(COMMON[ours])


def is_clock(column: ColumnPreview) -> bool:
    """Return whether a column is called as a time and rises as one: it is none of the signals."""
    return rank_by_name("time_s", column.name) == 0 and may_be_clock(column.cells)


def _is_setpoint(column: ColumnPreview) -> bool:
    """Whether a column taken for the command is the set point of a valve behind its own positioner."""
    return _rank("command_pa", column) == COMMON["command_pa"].index(SETPOINT) and column.unit not in UNITS["_pa"]


def _unit_of(ours: str, column: ColumnPreview, decimal: str) -> tuple[str, list[str]]:
    """Return `:UNIT` and what is open about it; nothing where the file says it or SI stands in the name."""
    if column.unit is not None:
        return f":{column.unit}", []
    if behind := column.units_behind:
        several = f"the units of {column.name!r} change, {' and '.join(behind)}: each cell is read in its own"
        return f":{behind[0]}", [several] if len(behind) > 1 else []
    if column.name == ours or not column.numbers:
        return "", []
    return _unit_not_said(ours, column, decimal)


def _unit_not_said(ours: str, column: ColumnPreview, decimal: str) -> tuple[str, list[str]]:
    """Return the unit that numbers, the name's end, or else sizes tell."""
    values = numbers_of(column.cells, decimal)
    if ours == "time_s" and (base := time_base(values)):
        return f":{base.unit}", [f"{column.name!r} is taken for {base.words}"]
    if ours == "time_s" and (written := digits_format(values)):
        return "", [f'the digits of {column.name!r} are a time of day: --time-format "{written}"']
    if unit := _at_the_end(ours, column.name):
        return f":{unit}", [f"the unit of {column.name!r} is taken from its name: {unit}"]
    if ours == "time_s":
        return "", [f"the unit of {column.name!r} is open: s is taken; :ms, :min, :d are others"]
    return _unit_by_size(ours, column, values[np.isfinite(values)])


def _unit_by_size(ours: str, column: ColumnPreview, values: Array) -> tuple[str, list[str]]:
    """Return the unit that a column's numbers may be in, and that it is a guess."""
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 100.0)
    if column.unknown.strip("[]() ").casefold() in {"v", "volt", "volts", "vdc"} or re.search(r"\bV\W*$", column.name):
        ranges = [volts for volts, least, most in VOLTS if least <= low and high <= most]
        if ranges:
            return f":{ranges[0]}", [f"the range of {column.name!r}, in volts, is open: {' or '.join(ranges)}"]
    if high > MOST_SHARE:
        allowed = ", ".join(UNITS[ending_of(ours)])
        return "", [f"the unit of {column.name!r} is open: numbers to {high:g} are no %; :UNIT of {allowed}, or SI"]
    guess = "%" if high > LEAST_PER_CENT else "bar" if ours == "command_pa" else "p.u."
    return f":{guess}", [f"the unit of {column.name!r} is open: {guess} is a guess"]


def _at_the_end(ours: str, name: str) -> str | None:
    """Return the unit in which a name ends, as in stem_mm, Hub.Prozent or Travel mm; None if it does not."""
    *before, ending = re.split(r"[_.\s]+", name)
    unit = unit_named(ending) if before else None
    # `p_in` is an input, and no inch.
    return unit if unit in list_allowed_units(ending_of(ours)) and unit != "in" else None


def _time_format(column: ColumnPreview, open_: list[str]) -> str | None:
    texts = [str(cell) for cell in column.cells if cell != "" and begins_number(cell)]
    if not texts or all(re.match(STAMP, text) for text in texts):
        return None
    formats = propose_formats(texts)
    if not formats:
        open_.append(f"how {texts[0]!r} is to be read is open: --time-format")
        return None
    if len(formats) > 1:
        open_.append(f"{texts[0]!r} may be read as {' or '.join(formats)}: the first is proposed")
    return formats[0]


def quote_word(word: str) -> str:
    """Return a word as it is typed in a shell."""
    plain = " ".join(word.split())
    if re.fullmatch(r"[\w=:.%+/@,#-]+", plain):
        return plain
    return shlex.quote(plain) if '"' in plain else f'"{plain}"'

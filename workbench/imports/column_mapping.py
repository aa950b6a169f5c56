"""What a person says of an export: which column is which, which rows are good, how numbers and dates are written."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from config.errors import InputError
from config.recording import BEHIND_POSITIONER, OF_DRIVES, REQUIRED
from workbench.imports.cell_units import SHARES, UNITS, ending_of, list_allowed_units

RANGE_PA = (0.2e5, 1.0e5)
"""The pressures of 0 % and 100 % that are assumed, and told, where nobody says others: the field's 0.2 to 1 bar."""


@dataclass(frozen=True, slots=True)
class Source:
    """Where one of our columns comes from; the unit None is what the file says, or else SI."""

    name: str
    theirs: str
    unit: str | None


@dataclass(frozen=True, slots=True)
class Status:
    """A column that says which rows are good."""

    theirs: str
    good: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ExportOptions:
    """How an export is read beyond its columns.

    Attributes:
        decimal: the decimal sign, "." or ","; None: as the numbers themselves show.
        time_format: of `datetime.strptime`; None: seconds or ISO 8601.
        status: rows of other words hold no values.
        sheet: of a workbook, or group of a measurement file; None: the one that has the columns.
        period_s: between the rows of a file without a time.
    """

    decimal: str | None = None
    time_format: str | None = None
    status: tuple[Status, ...] = ()
    sheet: str | None = None
    period_s: float | None = None


def read_mapping(words: Sequence[str], period_s: float | None = None) -> tuple[Source, ...]:
    """Read `OURS=THEIRS` or `OURS=THEIRS:UNIT`, one a column; no time of a file whose rows are a period apart.

    Raises:
        InputError: no such form, an unknown unit (names those there are), or a column that stands twice.
    """
    sources = tuple(_source(word) for word in words)
    names = [each.name for each in sources]
    possible = (REQUIRED, BEHIND_POSITIONER, *OF_DRIVES)
    required = next((each for each in possible if set(each) <= set(names)), None) or _nearest(names)
    if period_s is not None and "time_s" in names:
        raise InputError("--period-s", "goes with a file without a time: leave out it or --column time_s")
    for name in (*required, *names):
        if name not in names and not (name == "time_s" and period_s is not None):
            without = ", or --period-s S if no column is a time" if name == "time_s" else ""
            raise InputError("--column", f"{name} is not given: add --column {name}=THEIRS:UNIT{without}")
        if names.count(name) > 1:
            raise InputError("--column", f"{name} is given {names.count(name)} times: give it once")
    return sources


def _nearest(names: Sequence[str]) -> tuple[str, ...]:
    """Return the columns of which one is missing: a set point's where one is given, else those of its kind."""
    if "reference_m" in names and "command_pa" not in names:
        return BEHIND_POSITIONER
    return next((each for each in OF_DRIVES if {*each[1:]} & {*names} - {*REQUIRED}), REQUIRED)


def _source(word: str) -> Source:
    match = re.fullmatch(rf"(\w+?({'|'.join(UNITS)}))=(.+?)(?::([^:)]*))?", word)
    if match is None:
        endings = ", ".join(UNITS)
        raise InputError("--column", f"{word!r}: must be OURS=THEIRS:UNIT, OURS ending in {endings} (position_m=PV:%)")
    name, theirs, unit = match[1], match[3], match[4]
    ending = ending_of(name)
    allowed = list_allowed_units(ending)
    plain = (unit or "").removeprefix("-")
    turned = unit is not None and unit != plain
    if unit is not None and (plain not in allowed or (turned and not _can_be_turned(ending, plain))):
        also = {"_m": "; with - before it, as in -%, from the other end", "_pa": "; or -%, -mA, -p.u."}.get(ending, "")
        raise InputError("--column", f"{word!r}: unknown unit {unit!r}; allowed: {', '.join(allowed)}{also}")
    return Source(name, theirs, unit)


def list_units(ours: str) -> list[str]:
    """Return the units that a column of ours may be in, those from the other end too.

    >>> list_units("position_m")[:3], list_units("position_m")[-1]
    (['m', 'cm', 'mm'], '-2-10V')
    """
    ending = ending_of(ours)
    allowed = list_allowed_units(ending)
    return [*allowed, *(f"-{unit}" for unit in allowed if _can_be_turned(ending, unit))]


def _can_be_turned(ending: str, unit: str) -> bool:
    return ending == "_m" or (ending == "_pa" and unit in SHARES)


def read_status(words: Sequence[str]) -> tuple[Status, ...]:
    """Read `THEIRS=GOOD,...`, one a status column.

    Raises:
        InputError: no such form.
    """
    found = []
    for word in words:
        theirs, _, good = word.rpartition("=")
        allowed = tuple(each.strip() for each in good.split(",") if each.strip())
        if not theirs or not allowed:
            raise InputError("--status", f"{word!r}: must be THEIRS=GOOD, or THEIRS=GOOD,FAIR for several")
        found.append(Status(theirs, allowed))
    return tuple(found)

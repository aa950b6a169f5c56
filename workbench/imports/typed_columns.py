"""A column's cells as numbers in SI: each cell in the unit behind it, else the one that the file or a person says.

9.80 mm | 1.02 cm | 1.10 cm          every cell by itself: programs for dashboards scale each number for the eye
Hub [mm] over 9.80 | 10.2            by the header
position_m=Hub:mm                    by the mapping; it is refused where the file says another one
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from math import isnan
from pathlib import Path

import numpy as np

from config.errors import InputError
from config.recording import REQUIRED, Column
from workbench.imports.cell_kinds import begins_number
from workbench.imports.cell_units import (
    ABSOLUTE,
    ATMOSPHERE_PA,
    SHARES,
    SI,
    UNITS,
    ending_of,
    list_allowed_units,
    split_unit,
)
from workbench.imports.column_mapping import Source
from workbench.imports.number_notation import is_numeral, number
from workbench.imports.sample_rows import Samples

LEAST_SHARE_TRAVEL = 0.2
"""Of numbers between 0 and 1: so much is a stem that moves, if they are shares; in % it is hardly any."""
Scale = tuple[float | None, tuple[float, float]]
"""The stroke, m, and the pressures of 0 % and 100 %, Pa, that shares are of."""


def numerals(samples: Samples, sources: Sequence[Source]) -> Iterator[str]:
    """Yield what shows how the numbers of a file are written."""
    for source in sources:
        for cell in samples.cells[source.theirs]:
            if isinstance(cell, str):
                yield cell if is_numeral(cell) else numeral if (numeral := split_unit(cell)[0]) != cell else ""


def unit_of(path: Path, source: Source, samples: Samples) -> str:
    """Return the unit of a column: as mapped, else as the file says, else SI.

    Raises:
        InputError: the file says another one than the mapping, or one of another quantity.
    """
    ending = ending_of(source.name)
    header = samples.header
    said = _behind_numbers(samples, source) or dict(
        [header.units[source.theirs]] if source.theirs in header.units else []
    )
    mapped = (source.unit or "").removeprefix("-")
    for unit, line in said.items():
        if unit not in list_allowed_units(ending):
            raise InputError(
                str(path),
                f"column {source.theirs!r} is in {unit} by {header.table.place} {line}, and {source.name} takes "
                f"{', '.join(list_allowed_units(ending))}: is it another column?",
            )
    if said:
        unit, line = next(iter(said.items()))
        if mapped and mapped != "iso" and not _file_units(mapped) & set(said):
            raise InputError(
                str(path),
                f"column {source.theirs!r} is in {unit} by {header.table.place} {line}, the mapping says {mapped}: "
                f"type --column {source.name}={source.theirs}:{unit}, or mend the file",
            )
        return source.unit or unit
    if unknown := header.unknown.get(source.theirs):
        if source.unit is None and ending != "_s":
            raise InputError(
                str(path),
                f"column {source.theirs!r} has {unknown!r} where its unit stands, which is none that is known: "
                f"type --column {source.name}={source.theirs}:UNIT, of {', '.join(list_allowed_units(ending))}",
            )
        samples.notes[f"unit of {source.theirs}, not known"] = unknown
    return source.unit or SI[ending]


def _file_units(unit: str) -> set[str]:
    """Return a unit as mapped, and as it stands in a file: there an absolute pressure may not say that it is one."""
    return {unit, unit[:-1] if unit in ABSOLUTE else unit}


def _behind_numbers(samples: Samples, source: Source) -> dict[str, int]:
    """Return the units that stand behind the numbers of a column, each with the line where it stands first."""
    found: dict[str, int] = {}
    for cell, line in zip(samples.cells[source.theirs], samples.lines, strict=True):
        if isinstance(cell, str) and cell and begins_number(cell):
            if unit := split_unit(cell)[1]:
                found.setdefault(unit, line)
            elif not found:  # the first number decides whether units stand behind them at all
                break
    return found


def in_si(path: Path, samples: Samples, source: Source, unit: str, decimal: str, scale: Scale) -> Column:
    """Return a column in SI, NaN where a cell holds no number; words are counted, and units that change told.

    Args:
        path: for messages.
        samples: the cells.
        source: which column.
        unit: of what has none behind it, see `unit_of`.
        decimal: the decimal sign.
        scale: what shares are of.

    Raises:
        InputError: not one number, a numeral that is none with this decimal sign, a number without a unit among such
            that have another, or a share of an unknown stroke.
    """
    raw, units = _numbers(path, samples, source, decimal)
    plain, turned = unit.removeprefix("-"), unit.startswith("-")
    own = Counter(each for each in units if each is not None)
    bare = next((row for row, each in enumerate(units) if each is None and raw[row] and not isnan(raw[row])), None)
    by_header = samples.header.units.get(source.theirs, (plain, 0))[0]
    if own and bare is not None and not {*own, by_header} <= _file_units(plain):
        raise InputError(
            str(path),
            f"{samples.header.table.place} {samples.lines[bare]}: {samples.cells[source.theirs][bare]!r} in "
            f"{source.theirs!r} has no unit, and others there are in {' and '.join(own)}: mend the file",
        )
    if plain == "%" and source.name == "position_m":
        low, high = float(np.nanmin(raw)), float(np.nanmax(raw))
        if 0.0 <= low <= high - LEAST_SHARE_TRAVEL and high <= 1.0:
            told = f"goes from {low:g} to {high:g} %: if these are shares of 1, position_m={source.theirs}:p.u."
            samples.notes[f"{source.theirs} in %"] = told
    if len(own) < 2:
        return _scale(raw, source, plain, scale, turned=turned)
    samples.notes[f"units of {source.theirs}, each cell by its own"] = ", ".join(
        f"{count} {name}" for name, count in own.most_common()
    )
    found = np.where(raw == 0.0, 0.0, np.nan)
    for each in own:
        rows = np.array([name == each for name in units])
        found[rows] = _scale(raw[rows], source, each, scale, turned=turned)
    return found


def _numbers(path: Path, samples: Samples, source: Source, decimal: str) -> tuple[Column, list[str | None]]:
    """Return a column's numbers, NaN where there is none, and the unit behind each."""
    cells = samples.cells[source.theirs]
    found = np.empty(len(cells))
    units: list[str | None] = [None] * len(cells)
    words = 0
    for row, cell in enumerate(cells):
        if not isinstance(cell, str):
            found[row] = cell
            continue
        value = number(cell, decimal)
        if value is None or (isnan(value) and begins_number(cell)):
            numeral, units[row] = split_unit(cell)
            value = number(numeral, decimal) if units[row] else value
        if value is None:
            other = "," if decimal == "." else "."
            raise InputError(
                str(path),
                f"{samples.header.table.place} {samples.lines[row]}: {cell!r} in {source.theirs!r} is no number with "
                f"the decimal sign {decimal}; if the file's is the other, --decimal {other}",
            )
        found[row] = value
        words += bool(cell) and isnan(value)
    found[~np.isfinite(found)] = np.nan
    if np.isnan(found).all():
        holds = ", ".join(sorted({repr(str(cell)) for cell in cells})[:3])
        remedy = "map another" if source.name in REQUIRED else f"leave out {source.name}"
        raise InputError(str(path), f"column {source.theirs!r} holds no number, only {holds}: {remedy}")
    if words:
        samples.notes[f"not numbers in {source.theirs}"] = str(words)
    return found, units


def _scale(raw: Column, source: Source, unit: str, scale: Scale, *, turned: bool) -> Column:
    """Return numbers of one unit in SI; see `cell_units`."""
    ending, (stroke_m, range_pa) = ending_of(source.name), scale
    if ending == "_m" and (unit in SHARES or turned) and stroke_m is None:
        said = f"-{unit}" if turned else unit
        raise InputError("--stroke-m", f"is needed to read {source.name} in {said}; give what 100 % is, in metres")
    if unit in SHARES and unit not in UNITS[ending]:  # mA are a share of 4 to 20, but of a drive a current
        factor, offset = SHARES[unit]
        share = factor * raw + offset
        share = 1.0 - share if turned else share
        low, high = (0.0, stroke_m or 0.0) if ending == "_m" else range_pa
        return np.asarray(low + (high - low) * share)
    si = UNITS[ending][unit] * raw - (ATMOSPHERE_PA if unit in ABSOLUTE else 0.0)
    return np.asarray((stroke_m or 0.0) - si if turned else si)

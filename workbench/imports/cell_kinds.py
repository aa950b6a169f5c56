"""What a cell may be: a number or a date, a number with its unit behind it; and what cells in a column may be."""

import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from workbench.imports.export_units import PROCESS_UNITS, unit_named
from workbench.imports.number_notation import is_numeral, number
from workbench.imports.raw_table import Cell

_NUMBER_BEGINS = re.compile("[+\u2212-]?[.,]?\\d")
_WITH_UNIT = re.compile(r"([+\u2212-]?[\d.,]+(?:[eE][+-]?\d+)?)\s*([^\d\s].*)")


def begins_number(cell: Cell) -> bool:
    """Return whether a cell is, or begins as, a number or a date."""
    return not isinstance(cell, str) or _NUMBER_BEGINS.match(cell) is not None


def split_unit(cell: str) -> tuple[str, str | None]:
    """Return the numeral of a cell and the unit behind it, in our spelling; None where none stands there.

    >>> parted("1,02 cm"), parted("949 mbar"), parted("50.1"), parted("12 furlong")
    (('1,02', 'cm'), ('949', 'mbar'), ('50.1', None), ('12 furlong', None))
    """
    match = None if is_numeral(cell) else _WITH_UNIT.fullmatch(cell)
    unit = unit_named(match[2]) if match else None
    return (match[1], unit) if match and unit else (cell, None)


def with_any_unit(cell: str) -> tuple[str, str]:
    """Return the numeral of a cell and the unit behind it, ours or a process's; "" where none stands there.

    >>> with_any_unit("12.3 m³/h"), with_any_unit("949 mbar"), with_any_unit("Bad Input")
    (('12.3', 'm³/h'), ('949', 'mbar'), ('Bad Input', ''))
    """
    numeral, unit = split_unit(cell)
    match = None if unit or is_numeral(cell) else _WITH_UNIT.fullmatch(cell)
    return (match[1], match[2]) if match and PROCESS_UNITS.fullmatch(match[2]) else (numeral, unit or "")


def numbers_of(cells: Sequence[Cell], decimal: str) -> npt.NDArray[np.float64]:
    """Return the numbers of some cells, NaN for words, whatever unit stands behind them."""
    found = [cell if isinstance(cell, float) else number(with_any_unit(cell)[0], decimal) for cell in cells]
    return np.array([np.nan if each is None else each for each in found])


def may_be_clock(cells: Sequence[Cell]) -> bool:
    """Return whether cells may be a clock's: stamps, or numbers that rise and never fall, or the other way round.

    >>> may_be_clock([0.0, 0.5, 1.0]), may_be_clock(["5-Mar-26 8:15:00", "5-Mar-26 8:15:01"]), may_be_clock([5.0] * 3)
    (True, True, False)
    """
    held = [cell for cell in cells if cell != ""]
    if len(held) < 2 or not all(begins_number(cell) for cell in held):
        return False
    if all(isinstance(cell, str) and re.search(r"\d:\d\d|\d{4}-\d\d-\d\d", cell) for cell in held):
        return True
    for decimal in ".,":
        with np.errstate(over="ignore"):  # 1e308 and its like are no clock
            steps = np.diff(numbers_of(held, decimal))
        if np.isfinite(steps).all():
            return bool(steps.any()) and bool((steps >= 0).all() or (steps <= 0).all())
    return False

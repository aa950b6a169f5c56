"""What a cell may be: a number or a date; and what cells in a column may be."""

import re
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from workbench.imports.cell_units import with_any_unit
from workbench.imports.number_notation import number
from workbench.imports.raw_table import Cell

_NUMBER_BEGINS = re.compile("(?!\\d+[-_]?[A-Za-z]{2,}[-_]?\\d{2,}\\w*[._/]\\w*[A-Za-z])[+\u2212-]?[.,]?\\d")
"""But no tag that begins with the number of its unit, as 30FC1021.PV does."""


def begins_number(cell: Cell) -> bool:
    """Return whether a cell is, or begins as, a number or a date.

    >>> [begins_number(each) for each in ("30FC1021.PV", "05-Mar-26 08:15:00 PM", "12 ft3/min", "Bad")]
    [False, True, True, False]
    """
    return not isinstance(cell, str) or _NUMBER_BEGINS.match(cell) is not None


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

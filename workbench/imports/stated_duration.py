"""The unit of clocks that have none, by a header that says when its recording begins and ends.

StartTime,2026-03-05 08:15:00
EndTime,2026-03-05 08:20:00        0 to 299500 in 300 s: ms
"""

import re
from collections.abc import Iterable, Sequence

import numpy as np

from config.errors import InputError
from workbench.imports.cell_kinds import may_be_clock, numbers_of
from workbench.imports.cell_units import UNITS
from workbench.imports.number_notation import decimal_sign
from workbench.imports.raw_table import Cell
from workbench.imports.time_stamps import duration_s

BEGIN, END = "start|begin|anfang|d[eé]but|inici|inizi|pocz", "end|stop|fin|koniec"
"""How the label of either is called, in the languages of `column_names`."""
DURATION_TOLERANCE = 0.1
"""Of the duration: stamps in whole seconds and a last step are less, and units lie apart by ten and more."""


def stated_duration_s(above: Iterable[Sequence[Cell]]) -> float | None:
    """Return how long a recording lasts by the rows above its names, s; None where they do not say.

    >>> stated_duration_s([["StartTime", "05.03.2026 08:15:00"], ["EndTime", "05.03.2026 08:20:00"]])
    300.0
    """
    stamps: list[str] = []
    for row in above:
        label, *stamp = [str(cell) for cell in row if cell != ""] or [""]
        if stamp and len(stamps) < 2 and re.search((BEGIN, END)[len(stamps)], label, re.IGNORECASE):
            stamps.append(" ".join(stamp))
    return duration_s(stamps) if len(stamps) == 2 else None


def unit_by_duration(columns: Iterable[Sequence[Cell]], separator: str, lasts_s: float) -> str | None:
    """Return the unit in which one of some columns, as a clock, lasts so long; None where none does, or they differ."""
    found: set[str] = set()
    for cells in filter(may_be_clock, columns):
        try:
            counted = numbers_of(cells, decimal_sign("", filter(None, map(str, cells)), separator))
        except InputError:
            continue
        counted = counted[np.isfinite(counted)]
        spans = {unit: factor * float(np.ptp(counted)) for unit, factor in UNITS["_s"].items() if unit != "iso"}
        found |= {unit for unit, span_s in spans.items() if abs(span_s / lasts_s - 1.0) < DURATION_TOLERANCE}
    return found.pop() if len(found) == 1 else None

"""Which rows of a record tell something: those about a change of the command or a move of the stem.

While a command is held and the stem stands still, one row says what all say. After each change or move the first ten
rows are kept, then ever fewer, the time since growing by a fifth: no lag is so slow that it would not be seen. The row
before a change is kept too. A command held over the rows left out is the same as over one long period: exact.
"""

import numpy as np

from config.recording import Column
from signals.moves import moving
from workbench.data.record import Mask, Record

FIRST_ROWS_KEPT, LONGER = 10, 1.2
"""Rows kept after each event, and the ratio of the ages of those kept later."""
MOST_LATER = 60


def eventful(record: Record, drive_pa: Column, first: int, end: int) -> Mask:
    """Return which of the rows first to end (half open) tell something, (end - first,).

    Args:
        record: the record.
        drive_pa: what drives the model, held from each row to the next, Pa, (n,).
        first: of a segment.
        end: of it.
    """
    count = end - first
    happens = np.zeros(count, np.bool_)
    happens[0] = True
    happens[1:] |= np.diff(drive_pa[first:end]) != 0.0
    x = np.where(record.valid, record.position_m, np.nan)[first:end]
    happens[1:] |= moving(x, record.scale_m)
    if record.load_n is not None:
        happens[1:] |= np.diff(record.load_n[first:end]) != 0.0
    rows = np.arange(count)
    age = rows - np.maximum.accumulate(np.where(happens, rows, 0))
    later = np.unique((FIRST_ROWS_KEPT * LONGER ** np.arange(MOST_LATER)).astype(np.int64))
    keep = (age < FIRST_ROWS_KEPT) | np.isin(age, later[later < count])
    keep[:-1] |= happens[1:]
    keep[-1] = True
    return np.asarray(keep)

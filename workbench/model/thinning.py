"""A record with fewer rows, as if it had been sampled at longer periods: for searches that are far from their end.

    every = min(t_s / ROWS_A_SLIDE, CLOSE_S) / period          t_s how long a slide lasts (`sampling`), s

Of rows in closer succession each `every`-th is kept, and each at which the command jumps: steps stay where they are.
The command from one row that is kept to the next is its mean there; one that is held stays as it is. The first rows of
a segment are all kept, for they tell how it begins, and so are those outside of segments.
"""

from dataclasses import replace
from math import isinf

import numpy as np

from config.recording import Column
from config.valve_file import ValveParameters
from workbench.data.record import Mask, Record
from workbench.model.initial_state import LONGEST_START
from workbench.model.sampling import slide_time_s

ROWS_A_SLIDE = 6
"""A model is integrated from row to row as exactly as ever: these are what its course is compared at."""
CLOSE_S = 0.01
"""Rows farther apart than this cost less than the slips between them."""
JUMP = 0.25
"""Change of the pressure force from one row to the next, in F_c, from which the command jumps."""
ROUNDING = 1e-3
"""Of a period: what may be missing of a whole number of them."""


def thinned(record: Record, valve: ValveParameters) -> Record:
    """Return a record with fewer rows.

    It is itself where it is sampled slowly, where its command is no pressure, and of a stem without a spring, whose
    moves last as long as they are driven.
    """
    slide_s = slide_time_s(valve, record.scale_m)
    if record.by_setpoint or isinf(slide_s):
        return record
    every = int(min(slide_s / ROWS_A_SLIDE, CLOSE_S) / record.period_s + ROUNDING)
    if every < 2:
        return record
    keep = np.ones(len(record), np.bool_)
    jump_pa = JUMP * valve.coulomb_n / valve.diaphragm_area_m2
    for first, end in record.segments:
        keep[first + LONGEST_START : end - 1] = _kept(
            record.command_pa[first + LONGEST_START - 1 : end - 1], every, jump_pa
        )
    return _of_rows(record, keep)


def _kept(command_pa: Column, every: int, jump_pa: float) -> Mask:
    """Return which of the rows after the first are kept, (n - 1,)."""
    jumps = np.abs(np.diff(command_pa)) >= jump_pa
    return np.asarray(jumps | (np.arange(jumps.size) % every == 0))


def _of_rows(record: Record, keep: Mask) -> Record:
    rows, at = np.flatnonzero(keep), np.cumsum(keep) - 1

    def held(column: Column) -> Column:
        return np.asarray(np.add.reduceat(column, rows) / np.diff(rows, append=len(record)))

    return replace(
        record,
        time_s=record.time_s[rows],
        command_pa=held(record.command_pa),
        position_m=record.position_m[rows],
        pressure_pa=None if record.pressure_pa is None else record.pressure_pa[rows],
        pressure_known=None if record.pressure_known is None else record.pressure_known[rows],
        load_n=None if record.load_n is None else held(record.load_n),
        valid=record.valid[rows],
        segments=tuple((int(at[first]), int(at[end - 1]) + 1) for first, end in record.segments),
        commanded_from=tuple(int(at[row]) for row in record.commanded_from),
    )

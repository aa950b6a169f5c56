"""What a pressure path that remembers begins a segment with: what was commanded before, and when the stem leaves.

A record that begins in motion is judged from a rest on (`workbench.data.record`). Five time constants after a step a
lag still holds 0.7 % of it: taken for settled, it shifts all forces that are fitted by that much. What was commanded
before the record no sample says; a stem at rest leaves when the pressure has come to what breaks it loose.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from config.recording import Column
from sim.composition import Composition
from sim.karnopp import MEMORY, Vector
from sim.open_loop import check_commands, check_periods
from workbench.data.record import Record
from workbench.model.initial_state import BeforeStart, InitialState, before_start, initial_state


class Lead(NamedTuple):
    """From where a record, or a stretch of it after a gap, begins until the stem leaves, or its segment begins."""

    begin: InitialState
    """Of the stem as the record begins,"""
    time_s: float
    """when that is, s,"""
    before: BeforeStart
    """and which way it is seen to leave its place first."""
    drive_pa: Vector
    """Held from each of its samples to the next, Pa."""
    periods_s: Vector
    remembered: int
    """Periods between where the record begins and where the segment does."""
    memories: tuple[slice, ...]
    """Where the pressure path's memories stand in the state."""


def lead_of(record: Record, composition: Composition, drive_pa: Column, segment: int) -> Lead | None:
    """Return what leads to a segment, by its place among them; None where no effect remembers it.

    A positioner follows the stem: what it makes of a set point while the stem moved is not known by holding it.
    """
    first, end = record.segments[segment]
    begun = record.commanded_from[segment]
    memories = tuple(_path_memories(composition))
    if not memories or composition.by_setpoint:
        return None
    begin = initial_state(record, begun, end)
    before = before_start(record, begun, end, begin.position_m)
    until = max(first, begun + max(before.rests, 1))
    held_pa = check_commands(drive_pa[begun:until])
    periods_s = check_periods(np.diff(record.time_s[begun : until + 1]), held_pa)
    return Lead(begin, float(record.time_s[begun]), before, held_pa, periods_s, first - begun, memories)


def _path_memories(composition: Composition) -> Iterator[slice]:
    """Yield where the memories of the pressure path's effects stand in the state."""
    at = MEMORY
    for effect in composition.effects:
        if effect.memory and "pressure" in effect.functions:
            yield slice(at, at + effect.memory)
        at += effect.memory

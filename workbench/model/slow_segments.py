"""A record as it is simulated without inertia, where samples lie farther apart than slides last (`simulation_regime`).

A measured pressure goes in straight lines from part to part of a period, as `pressure_between_samples` has it; where
each rest is judged by itself it is the one at the period's end. Rows in which nothing happens are passed over
(`informative_rows`): between a command long held and the next one, with the measured stem at rest, only some are
simulated and judged. Where the command changed between samples, that of a period is the one at its end, the measured
positions say which way the stem went, and only rests that a slide ended in are judged. Behind a positioner a period is
cut into steps, for it feeds back on the pressure meanwhile, and all rows are judged.
"""

from collections.abc import Sequence
from math import ceil, inf, log2
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from config.recording import Column
from config.valve_file import ValveParameters
from sim.composition import AREA, SPRING, Composition
from sim.karnopp import Vector
from sim.open_loop import check_commands, check_periods
from sim.quasi_static import ALONG, FED_BACK, FREE
from workbench.data.informative_rows import eventful
from workbench.data.pressure_lag import command_followed_pa, pressure_lag_s
from workbench.data.record import Mask, Record
from workbench.model.initial_state import BeforeStart, InitialState, before_start, initial_state
from workbench.model.lead import Lead
from workbench.model.pressure_between_samples import ends_of_parts_pa
from workbench.model.simulation_regime import Motion, Sampling, landings

CASCADE = 16
"""Steps to a sample where effects of the pressure path with a memory follow each other."""
FED_BACK_STEPS = 10.0
"""Of a positioner's own with inertia: the longest step. A quarter of it moves a stem that hunts by as much."""
CLOSES, MOST_HALVINGS = 0.5, 3
"""Of the time in which pilot and stem close their loop, the longest step; at most so often it is halved for that."""
GAIN = "gain_pa_per_ms"
"""K of a positioner."""
PARTS = (0.01, 0.05, 0.2, 0.5, 1.0)
"""Where the parts of a period end, along a measured pressure: behind a fast I/P all of it happens in the first."""
JUDGED = 10
"""Samples of a landing that are judged at most: a long rest knows no more than its beginning."""


class SlowSegment(NamedTuple):
    """A stretch of a record without a gap, as it is simulated without inertia."""

    rows: npt.NDArray[np.int64]
    """Of the record that are simulated, ascending."""
    judged: npt.NDArray[np.int64]
    """Of the record that count in the error,"""
    at: npt.NDArray[np.int64]
    """and where they stand among those that are simulated."""
    begin: InitialState
    before: BeforeStart | None
    """As that of a `Segment`."""
    lead: Lead | None
    drive_pa: Vector
    """Of each period from one of the rows to the next, or of each of its parts, Pa."""
    load_n: Vector | None
    """The same of a measured load, N."""
    periods_s: Vector
    told: Vector
    """Of each of them, as `sim.quasi_static` takes it."""
    parts: int
    """Of a period."""
    step_s: float
    """Longest, s."""
    gain: int | None
    """Where K of a positioner stands among the parameters."""

    @property
    def first(self) -> int:
        """The row of the record that it begins with."""
        return int(self.rows[0])

    def bears_s(self, theta: Vector) -> float:
        """Return how long a step may be, s: shorter where pilot and stem close their loop in less, k_s / (K A).

        By halvings, lest a cost jumps wherever a gain is a little higher.
        """
        if self.gain is None:
            return self.step_s
        closes_s = theta[SPRING] / (theta[AREA] * theta[self.gain])
        halvings = ceil(log2(self.step_s / (CLOSES * closes_s)))
        return float(self.step_s / 2 ** min(max(halvings, 0), MOST_HALVINGS))


def slow_segments(
    record: Record,
    composition: Composition,
    drive_pa: Column,
    by: Sampling,
    from_pressure: bool,
    leads: Sequence[Lead | None],
) -> list[SlowSegment]:
    """Make the segments of a record ready to be simulated.

    Args:
        record: what was measured.
        composition: what is simulated.
        drive_pa: what enters it at each row, Pa; a set point, m.
        by: how the record is simulated.
        from_pressure: whether what enters is the measured pressure.
        leads: what was commanded before each segment.
    """
    at_end, along = from_pressure or not by.held, from_pressure and by.motion is Motion.QUASI_STATIC
    shares = np.diff(PARTS, prepend=0.0) if along else np.ones(1)
    parts = shares.size
    step_s, gain = _longest_s(record, composition), _gain_of(composition)
    told, judged = np.full(len(record), told_nothing(composition)), np.ones(len(record), np.bool_)
    if by.motion is Motion.LANDINGS:
        told, judged = _told(record, by.valve or composition.valve, by.held and by.sure)
    found = []
    for (first, end), lead in zip(record.segments, leads, strict=True):
        keep = (judged & (told != FREE) | (np.abs(told) == 1.0))[first:end]
        if by.held:
            keep |= eventful(record, drive_pa, first, end)
        if along:
            keep |= eventful(record, record.command_pa, first, end)
        keep[[0, -1]] = True  # a segment has its ends
        rows = first + np.flatnonzero(keep)
        counted = np.flatnonzero(judged[rows])
        following = rows[1:] if at_end else rows[:-1]
        held_pa = _along_pa(record, drive_pa, rows) if along else drive_pa[following]
        held_pa = check_commands(held_pa)
        load_n = None if record.load_n is None else check_commands(np.repeat(record.load_n[following], parts))
        periods_s = check_periods(np.outer(np.diff(record.time_s[rows]), shares).ravel(), held_pa)
        begin = initial_state(record, first, end, moving=False)
        before = before_start(record, first, end, begin.position_m) if composition.by_setpoint else None
        found.append(
            SlowSegment(
                rows=rows,
                judged=rows[counted],
                at=counted,
                begin=begin,
                before=before,
                lead=lead,
                drive_pa=held_pa,
                load_n=load_n,
                periods_s=periods_s,
                told=np.full(held_pa.size, ALONG) if along else told[rows[1:]],
                parts=parts,
                step_s=step_s,
                gain=gain,
            )
        )
    return found


def _along_pa(record: Record, pressure_pa: Column, rows: npt.NDArray[np.int64]) -> Column:
    """Return the pressure at the ends of the parts of the periods between rows of a segment, Pa, (periods * parts,)."""
    first, end = next(each for each in record.segments if each[0] == rows[0])
    u, p = record.command_pa, pressure_pa
    T = pressure_lag_s(record.period_s, u, p, [slice(*each) for each in record.segments])
    m = command_followed_pa(record.period_s, T, u[first:end], p[first:end])[rows - first]
    return ends_of_parts_pa(record.time_s[rows], u[rows], p[rows], m, T, PARTS).ravel()


def told_nothing(composition: Composition) -> float:
    """Return what a step is told of a stem that decides itself where it goes."""
    return FED_BACK if composition.by_setpoint else FREE


def _gain_of(composition: Composition) -> int | None:
    """Return where K of the positioner stands among the parameters, if it has one."""
    positioner = composition.positioner
    named = f"{positioner.name}.{GAIN}" if positioner else ""
    return composition.names.index(named) if named in composition.names else None


def _longest_s(record: Record, composition: Composition) -> float:
    """Return how long a step without inertia may be, s: one a sample, but where the pressure path bears less."""
    if composition.positioner:
        return FED_BACK_STEPS * composition.positioner.step_s
    remembering = sum("pressure" in each.functions and each.in_time for each in composition.effects)
    return record.period_s / CASCADE if remembering > 1 else inf


def _told(record: Record, valve: ValveParameters, held: bool) -> tuple[Column, Mask]:
    """Return the direction in which the stem went in the sample before each row, and which rows are judged, (n,)."""
    told, judged = np.zeros(len(record)), np.zeros(len(record), np.bool_)
    for rest, settled in landings(record, valve):
        told[rest.first] = rest.direction
        judged[rest.first : min(rest.end, rest.first + JUDGED)] = held or settled
    return told, judged

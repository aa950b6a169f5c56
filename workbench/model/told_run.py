"""The model through a record whose stem is told when it moves (`sim.told`).

A move is told by its onset, s, and its last sample in motion. The onset lies between samples: it is what a fit finds
besides the valve's parameters, one number a move. Where the model slides to, its friction alone says.

    x(theta, onsets)          indicated position, m, (n,)
    L_bears, L_breaks         static friction, N, by each rest (the largest load it bore) and by the load at each onset
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from config.recording import Column
from config.results.result import Brief
from signals.moves import Move, moves
from sim.composition import Composition
from sim.karnopp import Vector
from sim.open_loop import INDICATED, PATH_ROWS
from workbench.data.record import Record
from workbench.model.free_run import FreeRun, Segment
from workbench.model.sampling import DYNAMIC, Sampling

BEARS, BREAKS = 0, 1
RECORDS = 64
"""Whose moves are kept: each is asked for again by every model that is held against it."""


@dataclass(frozen=True, slots=True)
class ToldMove:
    """A move of a record: its rows, as `signals.moves`, in the record; of which segment, and to which row it counts."""

    segment: int
    before: int
    """Last row at rest, or the segment's first where it begins in motion."""
    after: int
    """First row at rest again, or the segment's last."""
    until: int
    """First row of the next move, or the segment's last: its rest is this move's landing."""
    rested_from: int
    """First row of the rest before it."""
    begins_in_motion: bool


@dataclass(frozen=True, slots=True, repr=False)
class ToldPath(Brief):
    """What a run comes to."""

    indicated_m: Column
    """(n,); NaN outside of the segments."""
    bears_n: Column
    """(moves,): the static friction that just bears the largest load of the rest before it."""
    breaks_n: Column
    """(moves,): that which the load at the onset just breaks."""


@lru_cache(maxsize=RECORDS)
def told_moves(record: Record) -> tuple[ToldMove, ...]:
    """Return the moves of a record, by its own positions."""
    found: list[ToldMove] = []
    for number, (first, end) in enumerate(record.segments):
        seen_m = np.where(record.valid, record.position_m, np.nan)[first:end]
        here: tuple[Move, ...] = moves(seen_m, record.scale_m)
        starts = [max(each.before, 0) for each in here]
        for k, each in enumerate(here):
            until = starts[k + 1] if k + 1 < len(here) else end - first - 1
            rested = here[k - 1].after if k else 0
            after = min(each.after, end - first - 1)
            found.append(
                ToldMove(number, first + starts[k], first + after, first + until, first + rested, each.before < 0)
            )
    return tuple(found)


def _acting_before(record: Record) -> Record:
    """Return a record whose command changed between samples: what is known at one has acted in the period before it."""
    return replace(record, command_pa=np.append(record.command_pa[1:], record.command_pa[-1:]))


class ToldRun:
    """A composition made ready to be told through a record, for one theta and set of onsets after another."""

    def __init__(
        self,
        composition: Composition,
        record: Record,
        told: tuple[ToldMove, ...],
        *,
        by: Sampling = DYNAMIC,
        from_pressure: bool = False,
    ) -> None:
        self.record, self.moves = record, told
        seen = record if by.held else _acting_before(record)
        self.free = FreeRun(composition, seen, from_pressure=from_pressure, by=DYNAMIC)
        self._composition = self.free._composition
        self._tell = self._composition.told.tell
        self._segments = [
            (each, [k for k, move in enumerate(told) if move.segment == number])
            for number, each in enumerate(self.free._segments)
        ]

        self._fed = {each.first: self._fed_m(each) for each, _ in self._segments}

    def _fed_m(self, segment: Segment) -> Vector:
        """Return what a positioner is fed: the measured stem, m, (periods + 1,); NaN where none obeys it."""
        if not self._composition.by_setpoint:
            return np.full(segment.periods_s.size + 1, np.nan)
        rows = np.arange(segment.first, segment.end)
        known = self.record.valid[rows]
        seen_m = np.interp(rows, rows[known], self.record.position_m[rows][known])
        return np.interp(np.arange(segment.periods_s.size + 1) / segment.parts, np.arange(rows.size), seen_m)

    def first_onsets_s(self) -> Vector:
        """Return the onsets as the samples show them: amid the period after the last sample at rest."""
        time_s = self.record.time_s
        return np.array([0.5 * (time_s[each.before] + time_s[each.before + 1]) for each in self.moves])

    def bounds_s(self, periods: float) -> tuple[Vector, Vector]:
        """Return between which times the onsets lie: so many periods about where they show, within their rests."""
        first, period_s, time_s = self.first_onsets_s(), self.record.period_s, self.record.time_s
        earliest = np.array([time_s[each.rested_from] for each in self.moves])
        latest = np.array([time_s[max(each.after - 1, each.before)] for each in self.moves])
        low = np.maximum(first - periods * period_s, earliest)
        return np.minimum(low, first - 0.5 * period_s), np.maximum(
            np.minimum(first + periods * period_s, latest), first + 0.5 * period_s
        )

    def run(self, theta: Vector, onsets_s: Vector) -> ToldPath:
        """Simulate; theta, (parameters,), as `composition.names`, onsets, s, (moves,)."""
        vector = np.array(theta[self.free._kept])
        indicated_m = np.full(len(self.record), np.nan)
        bears, breaks = np.zeros(len(self.moves)), np.zeros(len(self.moves))
        for segment, numbers in self._segments:
            drive_pa, state = self.free._started(vector, segment)
            held = self._held(segment, numbers, onsets_s)
            seen_m = self._fed[segment.first]
            path, loads = np.empty((PATH_ROWS, segment.periods_s.size + 1)), np.empty((2, segment.periods_s.size))
            self._tell(
                *(vector, state, drive_pa, segment.periods_s, held, seen_m),
                *(segment.step_s, self.free._tolerance, self.record.scale_m, path, loads),
            )
            indicated_m[segment.first : segment.end] = path[INDICATED, :: segment.parts]
            self._note_loads(segment, numbers, held, loads, bears, breaks)
        return ToldPath(indicated_m, bears, breaks)

    def _held(self, segment: Segment, numbers: list[int], onsets_s: Vector) -> Vector:
        """Return the share of each period for which the stem is held."""
        starts_s = self.record.time_s[segment.first] + np.concatenate([[0.0], np.cumsum(segment.periods_s)])
        held = np.ones(segment.periods_s.size)
        for k in numbers:
            move = self.moves[k]
            over = (move.after - segment.first) * segment.parts
            if move.begins_in_motion:
                held[:over] = 0.0
                continue
            at = int(np.searchsorted(starts_s, onsets_s[k], side="right")) - 1
            at = min(max(at, 0), held.size - 1)
            held[at + 1 : over] = 0.0
            held[at] = min(max((onsets_s[k] - starts_s[at]) / segment.periods_s[at], 0.0), 1.0)
            if held[at] == 1.0 and at + 1 < held.size:
                held[at + 1] = 0.0
        return held

    def _note_loads(
        self, segment: Segment, numbers: list[int], held: Vector, loads: Vector, bears: Vector, breaks: Vector
    ) -> None:
        for k in numbers:
            move = self.moves[k]
            rested = (move.rested_from - segment.first) * segment.parts
            loose = rested + int(np.argmax(held[rested:] < 1.0)) if (held[rested:] < 1.0).any() else held.size - 1
            bears[k] = float(np.max(loads[BEARS, rested:loose], initial=0.0))
            leaves = loose
            while leaves + 1 < held.size and loads[BREAKS, leaves + 1] > 0.0:
                leaves += 1  # let go before the load was there: it leaves with what breaks it loose
            breaks[k] = float(np.max(loads[:, loose : leaves + 1]))

"""The model through a record whose stem is told when it moves (`sim.told`).

A move is told by its onset, s, and its last sample in motion. The onset lies between samples: it is what a fit finds
besides the valve's parameters, one number a move. Where the model slides to, its friction alone says.

    x(theta, onsets)          indicated position, m, (n,)
    L_bears, L_breaks         static friction, N, by each rest (the largest load it bore) and by the load at each onset
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from config.recording import Column
from config.results.result import Brief
from signals.moves import Move, moves
from sim.composition import Composition
from sim.karnopp import Vector
from workbench.data.record import Record
from workbench.model.free_run import FreeRun, Segment
from workbench.model.simulation_regime import DYNAMIC, Sampling

Rows = npt.NDArray[np.int64]
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
    never_rests: bool
    """Whether it is all that its segment shows."""

    def breaks_loose(self, record: Record, gone_m: float) -> bool:
        """Whether it begins at rest, and goes farther than this, m: what creeps has not broken loose."""
        span_m = record.position_m[self.before : self.after + 1][record.valid[self.before : self.after + 1]]
        return not self.begins_in_motion and span_m.size > 0 and float(np.ptp(span_m)) > gone_m


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
            rows = (first + starts[k], first + after, first + until, first + rested)
            never_rests = each.before < 0 and each.after >= end - first
            found.append(ToldMove(number, *rows, each.before < 0, never_rests))
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
        self.record, self.moves, self.period_s = record, told, record.period_s
        seen = record if by.held else _acting_before(record)
        self.free = FreeRun(composition, seen, from_pressure=from_pressure, by=DYNAMIC)
        self._composition = self.free._composition
        self._tell = self._composition.told.tell
        self.hidden = any(each.hides_motion for each in self._composition.effects)
        """Whether the stem may move before it is seen to."""
        self._parts = [
            _part(each, [k for k, move in enumerate(told) if move.segment == number], told, record)
            for number, each in enumerate(self.free._segments)
        ]
        time_s = record.time_s
        self._first_onsets_s = np.array([0.5 * (time_s[each.before] + time_s[each.before + 1]) for each in told])
        self._first_onsets_s.setflags(write=False)
        self._fed = {each.segment.first: self._fed_m(each) for each in self._parts}
        self._last_shares: tuple[bytes, tuple[Vector, ...]] | None = None

    def _fed_m(self, part: "_Part") -> Vector:
        """Return what a positioner is fed: the measured stem, m, (periods + 1,); NaN, the simulated, without a rest.

        Where the stem rests, so does its pressure; where it never does, a pressure that is told the stem drifts.
        """
        segment = part.segment
        rests = not any(each.never_rests for each in self.moves[part.first : part.end])
        if not (self._composition.by_setpoint and rests):
            return np.full(segment.periods_s.size + 1, np.nan)
        rows = np.arange(segment.first, segment.end)
        known = self.record.valid[rows]
        seen_m = np.interp(rows, rows[known], self.record.position_m[rows][known])
        return np.interp(np.arange(segment.periods_s.size + 1) / segment.parts, np.arange(rows.size), seen_m)

    def first_onsets_s(self) -> Vector:
        """Return the onsets as the samples show them: amid the period after the last sample at rest."""
        return self._first_onsets_s

    def bounds_s(self, periods: float) -> tuple[Vector, Vector]:
        """Return between which times the onsets lie: so many periods about where they show, within their rests.

        A stem whose sensor may stay while it moves has left at any time of the rest.
        """
        first, period_s, time_s = self.first_onsets_s(), self.period_s, self.record.time_s
        earliest = np.array([time_s[each.rested_from] for each in self.moves])
        latest = np.array([time_s[max(each.after - 1, each.before)] for each in self.moves])
        low = earliest if self.hidden else np.maximum(first - periods * period_s, earliest)
        return np.minimum(low, first - 0.5 * period_s), np.maximum(
            np.minimum(first + periods * period_s, latest), first + 0.5 * period_s
        )

    def run(self, theta: Vector, onsets_s: Vector, *, eased: bool = False) -> ToldPath:
        """Simulate; theta, (parameters,), as `composition.names`, onsets, s, (moves,); eased as of `sim.told`."""
        vector, alone = np.array(theta[self.free._kept]), 0.0 if eased else 1.0
        indicated_m = np.full(len(self.record), np.nan)
        bears, breaks = np.zeros(len(self.moves)), np.zeros(len(self.moves))
        for part, held in zip(self._parts, self._rest_shares_of_parts(onsets_s), strict=True):
            segment = part.segment
            drive_pa, state = self.free._started(vector, segment)
            seen_m = self._fed[segment.first]
            shown_m, loads = np.empty(segment.periods_s.size + 1), np.empty((2, segment.periods_s.size))
            self._tell(
                *(vector, state, drive_pa, segment.periods_s, held, seen_m),
                *(segment.step_s, self.free._tolerance, self.record.scale_m, alone, shown_m, loads),
            )
            indicated_m[segment.first : segment.end] = shown_m[:: segment.parts]
            if part.rested.size:
                # What is held bears, what is let go breaks loose: between two rests' begins either is one move's.
                loads[0, held < 1.0] = 0.0
                bears[part.first : part.end], breaks[part.first : part.end] = np.maximum.reduceat(
                    loads, part.rested, axis=1
                )
        return ToldPath(indicated_m, bears, breaks)

    def _rest_shares_of_parts(self, onsets_s: Vector) -> tuple[Vector, ...]:
        """Return as `_rest_shares` of each segment; kept: of what is asked in turn the onsets are mostly one."""
        asked, last = onsets_s.tobytes(), self._last_shares
        if last is None or last[0] != asked:  # another thread may ask meanwhile
            self._last_shares = last = asked, tuple(self._rest_shares(part, onsets_s) for part in self._parts)
        return last[1]

    def _rest_shares(self, part: "_Part", onsets_s: Vector) -> Vector:
        """Return the share of each period for which the stem is held."""
        periods = part.starts_s.size - 1
        onset_s = onsets_s[part.first : part.end][part.let_go]
        at = np.maximum(np.minimum(np.searchsorted(part.starts_s, onset_s, side="right") - 1, periods - 1), 0)
        begins = part.begins.copy()
        begins[part.let_go] = at + 1
        loose = np.bincount(begins, minlength=periods + 1) - np.bincount(
            np.maximum(part.overs, begins), minlength=periods + 1
        )
        held: Vector = (np.cumsum(loose)[:-1] == 0).astype(np.float64)
        begin_s, end_s = part.starts_s[at], part.starts_s[at + 1]
        held[at] = np.maximum(np.minimum((onset_s - begin_s) / (end_s - begin_s), 1.0), 0.0)
        return held


@dataclass(frozen=True, slots=True)
class _Part:
    """The moves of one segment: which they are, first to end (half open), and where its periods begin."""

    segment: Segment
    first: int
    end: int
    starts_s: Vector
    """(periods + 1,)."""
    begins: Rows
    """First period loose throughout, of what begins in motion, (moves,)."""
    overs: Rows
    """First period held again, (moves,)."""
    rested: Rows
    """First period of the rest before, (moves,)."""
    let_go: Rows
    """Which of them begin at rest."""


def _part(segment: Segment, numbers: list[int], told: tuple[ToldMove, ...], record: Record) -> _Part:
    of = [told[k] for k in numbers]
    first = numbers[0] if numbers else 0
    starts_s = record.time_s[segment.first] + np.concatenate([[0.0], np.cumsum(segment.periods_s)])

    def periods(rows: list[int]) -> Rows:
        return segment.parts * (np.array(rows, dtype=np.int64) - segment.first)

    return _Part(
        segment=segment,
        first=first,
        end=first + len(of),
        starts_s=starts_s,
        begins=np.zeros(len(of), dtype=np.int64),
        overs=periods([each.after for each in of]),
        rested=periods([each.rested_from for each in of]),
        let_go=np.flatnonzero([not each.begins_in_motion for each in of]),
    )

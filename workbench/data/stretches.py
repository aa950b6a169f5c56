"""Of a long recording, the stretches that are fitted: spread over its time, in each part those that tell the most.

    work = rows that tell something + 20 slips        what a simulation costs (`informative_rows`, `motion`)

A recording whose work is no more than `FITTED_WORK` is fitted whole. A longer one is divided into `STRETCHES` of
equally many rows. In each the unbroken stretch is taken in which the stem travels the farthest, of those that cost no
more than their share. A stretch begins and ends in the middle of a rest, so that the model begins at rest, too, and
what lags has settled. Where nothing moves, nothing is taken. A column of its own, `stretch`, counts them.
"""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from config.recording import Recording
from signals.moves import slips
from workbench.data.informative_rows import eventful
from workbench.data.record import SLIP_ROWS, STRETCH, Record, ready

FITTED_WORK = 40_000
"""Of what is fitted and held out together."""
STRETCHES = 24  # stretches, evenly over the record
NAMED = 3
"""Stretches that are told with their times; of more, the first."""


class Move(NamedTuple):
    """A slip, and the rows from the middle of the rest before it to the middle of the one after (half open)."""

    first: int
    end: int
    travel_m: float
    work: float


def informative(recording: Recording) -> Recording:
    """Return the stretches of a recording that are worth fitting, or the recording itself if that can be fitted whole.

    Raises:
        InputError: as `ready`.
    """
    if len(recording) <= FITTED_WORK // (1 + SLIP_ROWS):
        return recording
    record = ready(recording)
    moves = [move for first, end in record.segments for move in _moves(record, first, end)]
    if sum(move.work for move in moves) <= FITTED_WORK:
        return recording
    return _only(recording, list(_stretches(moves, len(record))), len(moves))


def _moves(record: Record, first: int, end: int) -> Iterator[Move]:
    """Yield the moves of a segment; between the first and the last they leave no row out."""
    position_m = np.where(record.valid, record.position_m, np.nan)[first:end]
    slid = slips(position_m, record.scale_m)
    if not slid:
        return
    middles = [(before.last + after.first) // 2 for before, after in pairwise(slid)]
    longest = max((after.first - before.last for before, after in pairwise(slid)), default=end - first)
    edges = [max(0, slid[0].first - longest), *middles, min(end - first, slid[-1].last + longest)]
    telling = eventful(record, record.command_pa, first, end)[: edges[-1]]
    rows = np.add.reduceat(telling.astype(np.int64), edges[:-1])
    for each, (begin, over), count in zip(slid, pairwise(edges), rows.tolist(), strict=True):
        yield Move(first + begin, first + over, each.travel_m, count + SLIP_ROWS)


def _stretches(moves: Sequence[Move], count: int) -> Iterator[tuple[int, int]]:
    """Yield the rows of each stretch, half open, in order."""
    for part in range(STRETCHES):
        here = [move for move in moves if STRETCHES * move.first // count == part]
        if here:
            yield _farthest(here)


def _farthest(moves: Sequence[Move]) -> tuple[int, int]:
    """Return the rows of the unbroken run of moves with the most travel that costs no more than a part's share.

    A single move that costs more is taken nevertheless.
    """
    begin, work, travel_m = 0, 0.0, 0.0
    most_m, best = -1.0, (moves[0].first, moves[0].end)
    for last, move in enumerate(moves):
        if begin < last and move.first != moves[last - 1].end:
            begin, work, travel_m = last, 0.0, 0.0
        work, travel_m = work + move.work, travel_m + move.travel_m
        while begin < last and work > FITTED_WORK / STRETCHES:
            work, travel_m = work - moves[begin].work, travel_m - moves[begin].travel_m
            begin += 1
        if travel_m > most_m:
            most_m, best = travel_m, (moves[begin].first, move.end)
    return best


def _only(recording: Recording, stretches: Sequence[tuple[int, int]], moves: int) -> Recording:
    """Return the rows of the stretches, with what was left out told."""
    rows = np.concatenate([np.arange(first, end) for first, end in stretches])
    number = np.concatenate([np.full(end - first, n) for n, (first, end) in enumerate(stretches, start=1)])
    columns = {name: column[rows] for name, column in recording.columns.items()} | {STRETCH: number.astype(np.float64)}
    time_s = recording.time_s
    named = ", ".join(f"{time_s[first]:.6g} to {time_s[end - 1]:.6g} s" for first, end in stretches[:NAMED])
    more = f" and {len(stretches) - NAMED} more" if len(stretches) > NAMED else ""
    told = (
        f"{len(recording) - rows.size} of {len(recording)} samples: of {moves} slips those of {len(stretches)} "
        f"stretches are, in which the stem travels the farthest for what they cost, {named}{more}"
    )
    return Recording(columns, {**recording.metadata, "not fitted": told})

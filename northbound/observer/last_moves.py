"""The last minutes as a recording: at full rate from the daemon's recorder where it can be read, else as polled."""

import io
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from config.recorder_files import COLUMNS, files_of
from config.recording import Column, Recording
from config.travel import Travel
from northbound.observer.trends import WAITING
from northbound.observer.valve_view import ValveView
from positioner.response import ResponseFigures, respond

COUNTED = frozenset({"position_m", "reference_m"})
WRITTEN_WITHIN_S = 10.0
"""A recording that is not written any more is not of the last minutes."""
LONGEST_TAIL_BYTES = 12_000_000
"""Some two minutes at 1 kHz."""


@dataclass(frozen=True, slots=True)
class LastMoves:
    """The last minutes, where they come from, in words, and the response figures of their steps."""

    recording: Recording
    source: str
    response: ResponseFigures


def last_moves(
    view: ValveView,
    now_s: float,
    seconds: float,
    folder: Path | None,
    wall_s: float,
    travel: Travel | None = None,
) -> LastMoves | None:
    """Return the last minutes of a valve, None while nothing was measured.

    Args:
        view: the valve as polled.
        now_s: on the view's clock.
        seconds: how much.
        folder: where the daemon records, None where it does not.
        wall_s: now on the clock that files are stamped by.
        travel: of the valve: a recording has the stem, and what is returned counts from the closed end.
    """
    recording = None if folder is None else read_tail(folder, view.name, seconds, wall_s)
    if recording is not None and travel is not None and travel.closes:
        turned = {name: travel.stroke_m - recording.columns[name] for name in COUNTED & recording.columns.keys()}
        recording = Recording({**recording.columns, **turned})
    source = "the daemon's recording, at its full rate"
    if recording is None:
        recording = join_polls(view.trend(now_s - seconds))
        source = "as polled by this page: there is no recording of the daemon here, or it is old"
    return None if recording is None else LastMoves(recording, source, respond(recording))


def join_polls(trend: dict[str, Column]) -> Recording | None:
    """Return what was polled as a recording, without what was lost; None where there is nothing."""
    whole = np.isfinite(trend["position_m"]) & np.isfinite(trend["command_pa"])
    if not whole.any():
        return None
    return Recording({name: column[whole] for name, column in trend.items() if name != WAITING})


def read_tail(folder: Path, valve: str, seconds: float, wall_s: float) -> Recording | None:
    """Return the last seconds that were recorded; None where no recording is written, or none can be read."""
    try:
        newest = files_of(folder, valve)[-2:]
        if not newest or wall_s - newest[-1].stat().st_mtime > WRITTEN_WITHIN_S:
            return None
        lines = b"".join(_tail(file) for file in newest)
    except (OSError, ValueError):
        return None
    table = _table(lines)
    if not len(table):
        return None
    recent = table[table[:, 0] >= table[-1, 0] - seconds]
    return Recording({name: np.ascontiguousarray(recent[:, index]) for index, name in enumerate(COLUMNS)})


def _tail(file: Path) -> bytes:
    """Return the last whole rows of a recording."""
    with file.open("rb") as opened:
        size = opened.seek(0, os.SEEK_END)
        start = opened.seek(max(0, size - LONGEST_TAIL_BYTES // 2))
        data = opened.read()
    begin = data.find(b"\n") + 1 if start else 0
    return data[begin : data.rfind(b"\n") + 1]


def _table(lines: bytes) -> Column:
    """Return the rows, (n, columns), without comments and headers."""
    rows = b"\n".join(line for line in lines.splitlines() if line[:1] in b"-0123456789" and line)
    if not rows:
        return np.empty((0, len(COLUMNS)))
    return np.loadtxt(io.BytesIO(rows), delimiter=",", ndmin=2)

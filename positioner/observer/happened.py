"""What has happened to a valve: from its daemon's history where that can be read, else the newest events as served.

Over the bus a daemon says its newest event alone; those that came between two readings are counted, and not known.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from config.codes import EventKind, Ne107Status, cause_text
from config.errors import InputError
from positioner.history import HistoryReader
from positioner.history.entries import Event
from positioner.observer.words import code_text

FROM_HISTORY = "from the daemon's history"
AS_SERVED = "as served since this page looks; the daemon's history is off, or not on this machine"


@dataclass(frozen=True, slots=True)
class Happened:
    """A line: when, s since 1970, NaN where that is not known; what, in words; its NE 107 class."""

    time_s: float
    text: str
    ne107: str = ""


@dataclass(frozen=True, slots=True)
class WhatHappened:
    """The newest first, and where they come from."""

    lines: tuple[Happened, ...]
    source: str


def what_happened(folder: Path | None, valve: str, served: Iterable[Event], most: int) -> WhatHappened:
    """Return the newest events of a valve.

    Args:
        folder: of the daemon's history; None where it keeps none, or nobody said where.
        valve: its name in the history.
        served: events that were read over the bus, oldest first.
        most: that are returned.
    """
    source = AS_SERVED
    if folder is not None:
        try:
            with HistoryReader(folder) as history:
                return WhatHappened(tuple(_lines(history.events(valve, limit=most)))[::-1], FROM_HISTORY)
        except InputError as error:
            source = f"{AS_SERVED} ({error.problem})"
    return WhatHappened(tuple(_lines(served))[::-1][:most], source)


def served_event(valve: str, values: Mapping[str, float]) -> Event | None:
    """Return the newest event that a daemon serves, None before its first, or of a daemon that serves none."""
    number = values.get("event_number", math.nan)
    if not number > 0:
        return None
    kind, ne107, cause = (int(values[name]) for name in ("event", "event_class", "event_cause"))
    known = kind in list(EventKind)
    name = EventKind(kind).name if known else ""
    text = cause_text(EventKind(kind), cause) if known else ""
    return Event(valve, int(number), values["event_time"], kind, name, ne107, cause, text)


def _lines(events: Iterable[Event]) -> Iterator[Happened]:
    """Yield a line an event, oldest first, and one where numbers are missing."""
    events = list(events)
    for before, after in pairwise([None, *events]):
        assert after is not None
        if before is not None and after.number > before.number + 1:
            yield Happened(math.nan, f"{after.number - before.number - 1} events more, which were not read")
        ne107 = code_text("event_class", after.ne107) if after.ne107 != Ne107Status.GOOD else ""
        yield Happened(after.time_s, after.words, ne107)

"""What has happened to a valve, each thing once: from its daemon's history where that can be read, else as seen.

Over the bus a daemon says its newest event alone; those that came between two readings are counted, and not known.
Its codes are read far more often, so without a history it is they that tell what they can. Of the connection no history
knows: that is always told as seen.
"""

import math
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from config.codes import EventKind, Ne107Status, cause_text
from config.errors import InputError
from northbound.observer.register_words import code_text
from positioner.history import HistoryReader
from positioner.history.entries import Event

FROM_HISTORY = "from the daemon's history"
AS_SERVED = "seen since this page was opened; the daemon keeps no history, or not on this machine"
IN_CODES = frozenset(
    (
        EventKind.MODE,
        EventKind.FAULT,
        EventKind.FAULT_GONE,
        EventKind.HEALTH,
        EventKind.IDENTIFIED,
        EventKind.NOT_IDENTIFIED,
        EventKind.RESTORED,
        EventKind.EXPERIMENT,
    )
)
"""Kinds of event that registers of codes and counts tell of, too."""


@dataclass(frozen=True, slots=True)
class SeenEvent:
    """A change that was seen: when, s, and what, in words; whether it is one of the connection."""

    time_s: float
    text: str
    of_connection: bool = False


@dataclass(frozen=True, slots=True)
class Happened:
    """A line: when, s since 1970; what, in words; its NE 107 class, empty where that is good or said already."""

    time_s: float
    text: str
    ne107: str = ""


@dataclass(frozen=True, slots=True)
class WhatHappened:
    """The newest first, and where they come from."""

    lines: tuple[Happened, ...]
    source: str


def what_happened(
    folder: Path | None, valve: str, served: Iterable[Event], seen: Iterable[SeenEvent], off_s: float, most: int
) -> WhatHappened:
    """Return the newest events of a valve.

    Args:
        folder: of the daemon's history; None where it keeps none, or nobody said where.
        valve: its name in the history.
        served: events that were read over the bus, oldest first.
        seen: changes of registers and of the connection.
        off_s: what makes a time of `seen` one since 1970.
        most: that are returned.
    """
    source, in_codes, told = AS_SERVED, IN_CODES, list(served)
    if folder is not None:
        try:
            with HistoryReader(folder) as history:
                source, in_codes, told = FROM_HISTORY, frozenset(), history.events(valve, limit=most)
        except InputError as error:
            source = f"{AS_SERVED} ({error.problem})"
    lines = list(_lines(told, in_codes))
    lines += [Happened(each.time_s + off_s, each.text) for each in seen if each.of_connection or in_codes]
    newest_first = sorted(lines, key=lambda each: each.time_s, reverse=True)
    return WhatHappened(tuple(newest_first[:most]), source)


def read_event(valve: str, values: Mapping[str, float]) -> Event | None:
    """Return the newest event that a daemon serves, None before its first, or of a daemon that serves none."""
    number = values.get("event_number", math.nan)
    if not number > 0:
        return None
    kind, ne107, cause = (int(values[name]) for name in ("event", "event_class", "event_cause"))
    known = kind in list(EventKind)
    name = EventKind(kind).name if known else ""
    text = cause_text(EventKind(kind), cause) if known else ""
    return Event(valve, int(number), values["event_time"], kind, name, ne107, cause, text)


def _lines(events: Iterable[Event], without: Container[int]) -> Iterator[Happened]:
    """Yield a line an event, oldest first, and one where numbers are missing; none of the kinds left out."""
    for before, after in pairwise([None, *events]):
        assert after is not None
        if before is not None and after.number > before.number + 1:
            yield Happened(after.time_s, f"{after.number - before.number - 1} events before this, which were not read")
        if after.kind not in without:
            yield put_in_words(after)


def put_in_words(event: Event) -> Happened:
    """Return an event as a line that a page shows."""
    if event.kind == EventKind.HEALTH:
        ne107 = code_text("event_class", event.ne107)
        return Happened(event.time_s, f"NE 107: {ne107}" + (f", {event.text}" if event.text else ""))
    ne107 = code_text("event_class", event.ne107) if event.ne107 != Ne107Status.GOOD else ""
    return Happened(event.time_s, event.words, ne107)

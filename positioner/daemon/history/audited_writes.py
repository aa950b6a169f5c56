"""Writes and sessions of clients, each with peer and role; like ones one after another are one row with their number.

Two are alike if peer, what and text are the same and nothing else of the valve came between them; a heartbeat's value
is no part of its text, and heartbeats and all else are no hindrance to each other. A row is closed after `TOGETHER_S`,
so what a DCS writes again and again costs a row a minute. Of refused writes, and of sessions without a name, a host may
cause two rows a second after the first hundred; how many were passed over, the next one counts.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

from positioner.daemon.backoff import LinesPerPeer
from positioner.history.entries import Write

HEARTBEAT = "heartbeat"
TOGETHER_S = 60.0
GROWN_EVERY_S = 10.0
"""How often a row that only counts on is written."""
PEER = re.compile(r"(?:(?P<who>.*) \((?P<role>[a-z]+)\) at )?(?P<peer>[^ ]+)", re.DOTALL)
LONGEST_TEXT_CHARACTERS = 500
"""Characters of a text."""


class Told(NamedTuple):
    """A write or a session as its thread leaves it: `peer` is `host:port`, or `name (role) at host:port`."""

    time_s: float
    valve: str
    what: str
    peer: str
    text: str


def written_text(values: Mapping[str, float]) -> str:
    """Return what was written, in words.

    >>> written_text({"reference": 0.5, "heartbeat": 7})
    'reference = 0.5, heartbeat'
    """
    return ", ".join(name if name == HEARTBEAT else f"{name} = {value:.7g}" for name, value in values.items())


class AuditedWrites:
    """Makes rows of what is told, numbered from the last. In one thread."""

    def __init__(self, last_number: int) -> None:
        self._number = last_number
        self._open: dict[tuple[str, bool], Write] = {}
        """The newest row of each valve, its heartbeats apart."""
        self._written_s: dict[int, float] = {}
        self._unasked = LinesPerPeer()

    def rows(self, told: list[Told], now_s: float) -> list[Write]:
        """Return the rows to be written: new ones, those that are closed, those that have grown for long.

        Args:
            told: in the order in which it happened.
            now_s: on a clock that is never set.
        """
        changed: dict[int, Write] = {}
        for each in told:
            for row in self._taken(each, now_s):
                changed[row.number] = row
        for row in self._open.values():
            if row.times > 1 and now_s - self._written_s.get(row.number, 0.0) >= GROWN_EVERY_S:
                changed[row.number] = row
        for number in changed:
            self._written_s[number] = now_s
        opened = {row.number for row in self._open.values()}
        self._written_s = {number: at_s for number, at_s in self._written_s.items() if number in opened}
        return list(changed.values())

    def close(self) -> list[Write]:
        """Return the rows that have grown since they were written."""
        rows, self._open = [row for row in self._open.values() if row.times > 1], {}
        return rows

    def _taken(self, told: Told, now_s: float) -> list[Write]:
        """Take one; return the row before it, which is closed by it, and its own if that is new."""
        times = 1
        row = self._row(told)
        if told.what == "refused" or not (row.who or told.what == "write"):
            passed = self._unasked.unsaid(told.peer, now_s)
            if passed is None:
                return []
            times += passed
        place = told.valve, row.text == HEARTBEAT
        before = self._open.get(place)
        row = replace(row, times=times)
        if before is not None and _alike(before, row) and abs(told.time_s - before.begin_s) < TOGETHER_S:
            self._open[place] = replace(before, end_s=told.time_s, times=before.times + times)
            return []
        self._number += 1
        self._open[place] = row = replace(row, number=self._number)
        return [row] if before is None or before.times == 1 else [before, row]

    @staticmethod
    def _row(told: Told) -> Write:
        found = PEER.fullmatch(told.peer)
        peer, who, role = (found["peer"], found["who"] or "", found["role"] or "") if found else (told.peer, "", "")
        at_s = told.time_s
        return Write(0, told.valve, at_s, at_s, 1, told.what, peer, _storable(who), role, _storable(told.text))


def _storable(text: str) -> str:
    """Return a text as a file may hold it: of moderate length, and no half characters."""
    short = text if len(text) <= LONGEST_TEXT_CHARACTERS else f"{text[:LONGEST_TEXT_CHARACTERS]}.."
    return short.encode("utf-8", "replace").decode("utf-8")


def _alike(one: Write, other: Write) -> bool:
    return all(getattr(one, name) == getattr(other, name) for name in ("what", "peer", "who", "role", "text"))

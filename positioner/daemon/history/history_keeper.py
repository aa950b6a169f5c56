"""The thread that numbers what has happened and writes it into the history.

    the cycle, the health, each client  ->  bounded queues  ->  this thread  ->  one transaction a quarter of a second

Without table `[history]` events are numbered from the start and served, and nothing is kept. While the file cannot be
written (a full disk), what happens waits, so many entries at the most; control goes on, and one line of the log says
so. When it can be written again, an event says since when it could not and how many entries were lost. Times are taken
on a clock that is never set; that the gateway's was set is an event.
"""

import logging
import time
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from threading import Event as Flag
from threading import Lock, Thread

from config.codes import EventKind, Ne107Status
from config.daemon_file import DaemonFile
from config.record_tables import HistoryTable
from positioner.daemon.health.ne107 import FaultClasses
from positioner.daemon.history.audited_writes import AuditedWrites, Told
from positioner.daemon.history.configuration_changes import changes, in_words, settings_of
from positioner.daemon.history.decision_events import Happened
from positioner.daemon.history.valve_history import Found, ValveHistory
from positioner.daemon.logs import log_event
from positioner.history import HistoryFile, HistoryFull
from positioner.history.entries import Entry

log = logging.getLogger(__name__)

WRITE_EVERY_S = 0.25
HEALTH_EVERY_S = 60.0
EXPIRE_EVERY_S = 3600.0
RETRY_S = 1.0
MOST_WAITING = 10_000
"""Of all but the cycles, that wait for the thread."""
MOST_PENDING = 20_000
"""Entries that wait for a disk."""
GAP_EVERY_S = 60.0
"""From one event that tells of lost entries to the next, while they go on being lost."""
BATCH = 1000
"""Entries of a transaction at the most."""
SHRINK_EVERY = 500
"""Entries written from one look at the file's size to the next."""
CLOCK_SET_S = 1.0


class HistoryKeeper:
    """A thread from `start` to `stop`, for all valves of a daemon.

    Args:
        table: where, how long and how much; None keeps nothing.
        folder: that of the daemon's file.
        tell: takes writes, where another process of this daemon numbers them; it has opened the file before.

    Raises:
        InputError: the history cannot be kept there.
    """

    def __init__(self, table: HistoryTable | None, folder: Path, tell: Callable[[Told], None] | None = None) -> None:
        self.file = None
        if table is not None:
            where = folder / table.folder
            self.file = HistoryFile(where, table.keep_days, table.limit_mb, beside_another=tell is not None)
        self._tell = tell
        self._valves: list[ValveHistory] = []
        self._waiting: deque[Told | Found] = deque()
        self._offering = Lock()
        self._overflowed = 0
        self._pending: list[Entry] = []
        self._lost = self._told_lost = 0
        self._writes = AuditedWrites(0 if self.file is None else self.file.last_write())
        self._written = 0
        self._failed_since_s: float | None = None
        self._failure = ""
        self._retry_s = self._health_due_s = 0.0
        self._expire_due_s = self._gap_due_s = 0.0
        self._ahead_s = time.time() - time.monotonic()
        self._stopping = Flag()
        self._thread = Thread(target=self._work, name="history", daemon=True)

    def valve(self, file: DaemonFile, classes: FaultClasses) -> ValveHistory:
        """Return a valve's side, and take note that it starts. Before `start`."""
        history = ValveHistory(file.valve.name, classes, self)
        history.lost = lambda: self.lost
        self._valves.append(history)
        now_s, before = time.time(), None if self.file is None else self.file.newest_event(history.valve)
        started = f"version {version('positioner')}"
        if before is not None:
            history.newest = before
            if before.kind != EventKind.STOPPED:
                started += "; nothing says how it ended before: killed, or without power"
        self._enter(history, now_s, Happened(EventKind.STARTED, text=started))
        if before is not None and before.time_s > now_s + CLOCK_SET_S:
            self._enter(history, now_s, _clock_set(now_s - before.time_s))
        if self.file is not None:
            if self.file.set_aside is not None:
                fields = {"file": str(self.file.path), "reason": self.file.set_aside}
                log_event(log, logging.ERROR, "history unreadable, begun anew", **fields)
                self._enter(history, now_s, Happened(EventKind.HISTORY_ANEW, text=self.file.set_aside))
            rows = changes(history.valve, self.file.settings(history.valve), settings_of(file), now_s)
            self._pending += rows
            if said := in_words(rows):
                self._enter(history, now_s, Happened(EventKind.CONFIGURATION, text=said))
        return history

    @property
    def lost(self) -> int:
        """How many entries were lost since the start."""
        return self._lost + self._overflowed + sum(valve.changes_lost for valve in self._valves)

    def offer(self, what: Told | Found) -> None:
        """Take a write, a session or an event if there is room. Not for the cycle's thread."""
        if self._tell is not None and isinstance(what, Told):
            self._tell(what)
            return
        with self._offering:
            if len(self._waiting) < MOST_WAITING:
                self._waiting.append(what)
            else:
                self._overflowed += 1

    def session(self, peer: str, what: str, text: str) -> None:
        """Take what became of a client's connection. Called by the server's threads."""
        if self.file is not None:
            self.offer(Told(time.monotonic(), "", what, peer, text))

    def start(self) -> None:
        """Begin to write."""
        self._thread.start()

    def stop(self, reason: str) -> None:
        """Write what waits and how the daemon ended, and close the file."""
        self._stopping.set()
        if self._thread.ident is not None:
            self._thread.join()
        for valve in self._valves:
            self._enter(valve, time.time(), Happened(EventKind.STOPPED, text=reason))
        self._pending += self._writes.close()
        self._health_due_s = self._retry_s = 0.0
        self.turn()
        if self.file is not None:
            if self._pending:
                fields = {"entries": len(self._pending), "reason": self._failure}
                log_event(log, logging.ERROR, "the end of the history is lost", **fields)
            self.file.close()

    def turn(self) -> None:
        """Take what waits, and write it. In the thread; tests call it without one."""
        now_s = time.monotonic()
        self._look_at_the_clock(now_s)
        self._take()
        self._tell_of_the_lost(now_s)
        if self.file is None:
            self._pending.clear()
            return
        if now_s >= self._health_due_s:
            self._health_due_s = now_s + HEALTH_EVERY_S
            self._pending += self._health()
        if now_s >= self._retry_s:
            self._write(self.file, now_s)
        if (surplus := len(self._pending) - MOST_PENDING) > 0:
            del self._pending[MOST_PENDING:]
            self._lost += surplus

    def _work(self) -> None:
        while not self._stopping.wait(WRITE_EVERY_S):
            self.turn()

    def _enter(self, valve: ValveHistory, time_s: float, happened: Happened) -> None:
        """Number an event, and have it written."""
        self._pending.append(valve.numbered(time_s, happened))

    def _take(self) -> None:
        """Number what has happened, in its order, and make rows of what was written."""
        waiting = [self._waiting.popleft() for _ in range(len(self._waiting))]
        told = [each for each in waiting if isinstance(each, Told)]
        events = [each for each in waiting if isinstance(each, Found)]
        for valve in self._valves:
            events += valve.changes()
            if (happened := valve.switched()) is not None:
                events.append(Found(time.monotonic(), valve, happened))
        for at_s, valve, happened, identification in sorted(events, key=lambda each: each.time_s):
            self._enter(valve, at_s + self._ahead_s, happened)
            if identification is not None:
                self._pending.append(replace(identification, time_s=at_s + self._ahead_s))
        dated = [each._replace(time_s=each.time_s + self._ahead_s) for each in told]
        self._pending += self._writes.rows(dated, time.monotonic())

    def _look_at_the_clock(self, now_s: float) -> None:
        ahead_s = time.time() - now_s
        before_s, self._ahead_s = self._ahead_s, ahead_s
        if abs(ahead_s - before_s) > CLOCK_SET_S:
            for valve in self._valves:
                self._enter(valve, now_s + ahead_s, _clock_set(ahead_s - before_s))

    def _tell_of_the_lost(self, now_s: float) -> None:
        """Make an event of entries that found no room, unless the disk's return will tell of them."""
        if self._failed_since_s is None and now_s >= self._gap_due_s and (lost := self.lost - self._told_lost):
            self._gap_due_s = now_s + GAP_EVERY_S
            self._gap(f"{lost} entries were lost: more came at once than there was room for")

    def _gap(self, text: str) -> None:
        self._told_lost = self.lost
        for valve in self._valves:
            self._enter(
                valve, time.time(), Happened(EventKind.HISTORY_GAP, Ne107Status.MAINTENANCE_REQUIRED, text=text)
            )

    def _health(self) -> Iterable[Entry]:
        now_s = time.time()
        return [valve.hours.row(valve.look(), now_s) for valve in self._valves if valve.look is not None]

    def _write(self, file: HistoryFile, now_s: float) -> None:
        """Write what is pending; of a failure one line, of its end an event."""
        try:
            if now_s >= self._expire_due_s:
                self._expire_due_s = now_s + EXPIRE_EVERY_S
                file.expire(time.time())
            while batch := self._pending[:BATCH]:
                file.append(batch)
                self._written += len(batch)
                del self._pending[:BATCH]
            if self._written >= SHRINK_EVERY:
                self._written = 0
                file.shrink()
        except HistoryFull as error:
            self._retry_s = now_s + RETRY_S
            self._failure = str(error)
            if self._failed_since_s is None:
                self._failed_since_s = time.time()
                log_event(log, logging.ERROR, "the history cannot be written", file=str(file.path), reason=str(error))
            return
        if self._failed_since_s is not None:
            since, self._failed_since_s = datetime.fromtimestamp(self._failed_since_s, UTC), None
            lost = self.lost - self._told_lost
            said = f"could not be written from {since:%Y-%m-%dT%H:%M:%SZ} on ({self._failure}): {lost} entries lost"
            log_event(log, logging.WARNING, "the history is written again", entries_lost=lost)
            self._gap(said)


def _clock_set(by_s: float) -> Happened:
    return Happened(EventKind.CLOCK_SET, Ne107Status.MAINTENANCE_REQUIRED, text=f"by {by_s:+.1f} s")

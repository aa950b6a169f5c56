"""One valve's side of the history: what its cycle, its health and its clients leave for the thread that writes it."""

import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import NamedTuple, Protocol

from config.codes import EventKind, Ne107Status, cause_text
from positioner.control.controller_memory import Decision
from positioner.daemon.health.ne107 import FaultClasses
from positioner.daemon.history.audited_writes import Told, written_text
from positioner.daemon.history.decision_events import Happened, events_between, noted
from positioner.daemon.history.health_hours import HealthHours, HealthLook
from positioner.estimation.acceptance import Ratios
from positioner.estimation.estimates import Estimate
from positioner.history.entries import Event, Identification

MOST_CHANGES = 2_000
"""Of decisions, that wait for the thread."""
NO_RATIOS = Ratios(float("nan"), float("nan"), float("nan"))


class Found(NamedTuple):
    """What happened to a valve, when, s on a clock that is never set, and the identification that it tells of."""

    time_s: float
    valve: "ValveHistory"
    happened: Happened
    identification: Identification | None = None


class Queue(Protocol):
    """What a valve needs of the keeper."""

    def offer(self, what: Told | Found) -> None:
        """Take it if there is room."""
        ...


class ValveHistory:
    """Made by `HistoryKeeper.valve`.

    Args:
        valve: its name.
        classes: of its faults, by the daemon's file.
        queue: of the keeper.
    """

    def __init__(self, valve: str, classes: FaultClasses, queue: Queue) -> None:
        self.valve = valve
        self.newest = Event(valve, 0, 0.0, int(EventKind.NONE), EventKind.NONE.name, 0, 0, "")
        """The newest event; replaced whole by the keeper's thread."""
        self.changes_lost = 0
        """Changes of decisions that found no room; counted by the cycle thread alone."""
        self.hours = HealthHours(valve)
        self.look: Callable[[], HealthLook] | None = None
        """Returns the valve's health now; called by the keeper's thread."""
        self.lost: Callable[[], int] = lambda: 0
        """Returns how many entries were lost since the start, of all valves."""
        self.locked: Callable[[], bool] = lambda: False
        """Returns whether the local switch locks out; called by the keeper's thread."""
        self._was_locked = False
        self._classes = classes
        self._queue = queue
        self._changes: deque[tuple[float, Decision, Decision]] = deque()

    def enter(self, before: Decision, after: Decision) -> None:
        """Take a decision and the one before it. Called by the cycle thread; never blocks."""
        if noted(before) == noted(after):
            return
        if len(self._changes) < MOST_CHANGES:
            self._changes.append((time.monotonic(), before, after))
        else:
            self.changes_lost += 1

    def happened(self, happened: Happened) -> None:
        """Take an event of another thread than the cycle's."""
        self._queue.offer(Found(time.monotonic(), self, happened))

    def wrote(self, peer: str, values: Mapping[str, float]) -> None:
        """Take a client's write that was obeyed."""
        self._queue.offer(Told(time.monotonic(), self.valve, "write", peer, written_text(values)))

    def refused(self, peer: str, reason: str) -> None:
        """Take a client's write that was refused."""
        self._queue.offer(Told(time.monotonic(), self.valve, "refused", peer, reason))

    def switched(self) -> Happened | None:
        """Return what the local switch has done since the last call. In the keeper's thread."""
        before, self._was_locked = self._was_locked, self.locked()
        if before == self._was_locked:
            return None
        away = Happened(EventKind.LOCKED_OUT, Ne107Status.FUNCTION_CHECK)
        return Happened(EventKind.LET_IN) if before else away

    def changes(self) -> list[Found]:
        """Return what has happened in the cycle since the last call. In the keeper's thread."""
        found: list[Found] = []
        for _ in range(len(self._changes)):
            time_s, before, after = self._changes.popleft()
            for happened in events_between(before, after, self._classes):
                judged = happened.kind in (EventKind.IDENTIFIED, EventKind.NOT_IDENTIFIED)
                identification = self._identification(time_s, after, happened) if judged else None
                found.append(Found(time_s, self, happened, identification))
        return found

    def numbered(self, time_s: float, happened: Happened) -> Event:
        """Return an event as the next one, s since 1970. In the keeper's thread."""
        kind, status, cause, text = happened
        text = text or cause_text(kind, int(cause))
        self.newest = Event(
            self.valve, self.newest.number + 1, time_s, int(kind), kind.name, int(Ne107Status(status)), int(cause), text
        )
        return self.newest

    def _identification(self, time_s: float, decision: Decision, happened: Happened) -> Identification:
        found, ratios = decision.estimates, decision.applied.ratios or NO_RATIOS
        each: tuple[Estimate, ...] = (
            found.a, found.b, found.c, found.k, found.b_over_c, found.k_over_c, found.breakaway,
        )  # fmt: skip
        values = [number for estimate in each for number in (estimate.value, estimate.std)]
        applied = happened.kind is EventKind.IDENTIFIED
        reason = decision.applied.last_refusal.text
        values += [ratios.b_over_c, ratios.k_over_c, ratios.offset_pa]
        return Identification(self.valve, time_s, int(applied), reason, *values)

"""Keeps what is known of a valve, beside the cycle.

It is written at once when an identification was applied or what was restored was confirmed, a minute after the last
time when landings have come, and at the end. What a landing contradicts is set aside, so that the next start does not
take it up again.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from config.codes import Restored
from config.errors import explain_failure
from positioner.control.controller_memory import Decision
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.daemon.keeping_thread import WRITE_EVERY_CHECKS
from positioner.daemon.logs import log_event, logging_valve
from positioner.daemon.memory.known_configuration import Conditions
from positioner.daemon.memory.memory_file import Kept, read_memory, set_aside, write_memory
from positioner.daemon.sole_daemon import MEMORY, valve_file_path

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class StoredMemory:
    """A valve's file, the conditions of now, and what was in it at the start."""

    path: Path
    conditions: Conditions
    kept: Kept

    @classmethod
    def in_folder(cls, folder: Path, valve: str, conditions: Conditions) -> "StoredMemory":
        """Read what is kept of a valve, and make sure that the folder is there.

        Raises:
            InputError: the folder cannot be made, the file not be read.
        """
        path = valve_file_path(folder, valve, MEMORY)
        with explain_failure(path, "what is known cannot be kept there"):
            folder.mkdir(parents=True, exist_ok=True)
            return cls(path, conditions, read_memory(path, valve, conditions))


class MemoryKeeper:
    """Looked at from `start` to `stop`.

    Args:
        stored: the file.
        valve: its name.
        decided: the last decision of its controller.
        knowledge: what its controller knows now, to be kept; None: nothing.
        now_s: the time of the last sample, on the clock of what is known.
    """

    def __init__(
        self,
        stored: StoredMemory,
        valve: str,
        decided: Callable[[], Decision],
        knowledge: Callable[[], ValveKnowledge | None],
        now_s: Callable[[], float],
    ) -> None:
        self._stored, self.valve = stored, valve
        self._decided, self._knowledge, self._now_s = decided, knowledge, now_s
        self._trust = Restored.NOTHING if stored.kept.knowledge is None else Restored.PROVISIONAL
        self._identifications = 0
        self._written: ValveKnowledge | None = None
        self._checks, self._failed = 0, False

    def start(self) -> None:
        """Say what was restored, or why it was not."""
        kept, file = self._stored.kept, str(self._stored.path)
        with logging_valve(self.valve):
            if kept.problem is not None:
                log_event(log, logging.WARNING, "memory set aside", file=file, reason=kept.problem)
            elif kept.knowledge is not None:
                log_event(log, logging.INFO, "memory restored, provisional", file=file, written=kept.written)

    def stop(self) -> None:
        """Keep what is known."""
        with logging_valve(self.valve):
            self.check()
            self.store()

    def check(self) -> None:
        """Check once: set aside what was contradicted, write when it is time."""
        decision = self._decided()
        trust, count = decision.restoration.trust, decision.applied.count
        news = trust is not self._trust or count != self._identifications
        if trust is Restored.DROPPED and trust is not self._trust:
            self._drop()
        self._trust, self._identifications = trust, count
        self._checks += 1
        if news or self._checks % WRITE_EVERY_CHECKS == 0:
            self.store()

    def store(self) -> None:
        """Write what is known, if there is more than when it was last written; one line of the log when that fails."""
        knowledge = self._knowledge()
        if knowledge is None or knowledge == self._written:
            return
        try:
            aged = knowledge.aged(self._now_s())
            write_memory(self._stored.path, self.valve, self._stored.conditions, aged)
        except OSError as error:
            self._say_failed(error)
            return
        self._written, self._failed = knowledge, False

    def _drop(self) -> None:
        try:
            set_aside(self._stored.path)
        except FileNotFoundError:
            pass
        except OSError as error:
            self._say_failed(error)
        reason = "a landing contradicts it: identify the valve"
        log_event(log, logging.WARNING, "memory set aside", file=str(self._stored.path), reason=reason)

    def _say_failed(self, error: OSError) -> None:
        if not self._failed:
            fields = {"file": str(self._stored.path), "reason": error.strerror}
            log_event(log, logging.ERROR, "memory cannot be written", **fields)
        self._failed = True

"""Structured logs: one JSON object a line on standard error, written by a thread of its own.

A cycle that says something puts it into a queue; the queue's thread formats and writes. The queue is bounded: a line
without room is counted, and the next that is written says in `lines_lost` how many are missing before it.
"""

import json
import logging
import queue
import sys
from contextvars import ContextVar
from datetime import UTC, datetime
from logging.handlers import QueueHandler, QueueListener
from threading import Thread
from typing import Any, TextIO

from config.json_value import json_value

MOST_WAITING = 5_000
"""Records; of a standard error that nobody reads for longer, the rest is lost."""
FLUSH_S = 2.0
"""How long the end of the daemon waits for lines that are not yet written."""

_VALVE: ContextVar[str | None] = ContextVar("valve", default=None)


class logging_valve:  # noqa: N801 - used as a function is, and in each cycle: a generator takes three times as long
    """Have every line that this thread logs in the meantime name a valve."""

    __slots__ = ("_token", "_valve")

    def __init__(self, valve: str | None) -> None:
        self._valve = valve

    def __enter__(self) -> None:
        self._token = _VALVE.set(self._valve)

    def __exit__(self, *_: object) -> None:
        _VALVE.reset(self._token)


def log_event(log: logging.Logger, level: int, event: str, **fields: object) -> None:
    """Log an event with its fields, as data."""
    if log.isEnabledFor(level):
        log.log(level, event, extra={"fields": fields})


class JsonLines(logging.Formatter):
    """`{"time": ..., "level": ..., "source": ..., "valve": ..., "event": ..., fields...}`."""

    def format(self, record: logging.LogRecord) -> str:
        """Return one line."""
        line = {
            "time": datetime.fromtimestamp(record.created, UTC).isoformat(timespec="milliseconds"),
            "level": record.levelname.lower(),
            "source": record.name,
            **({"valve": valve} if (valve := getattr(record, "valve", None)) else {}),
            "event": record.getMessage(),
            **getattr(record, "fields", {}),
            **({"lines_lost": lost} if (lost := getattr(record, "lines_lost", 0)) else {}),
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(json_value(line), default=str, allow_nan=False)


class _Unformatted(QueueHandler):
    """Hands records over as they are, so that the thread that logs does no formatting; notes the valve in them."""

    def __init__(self, records: "queue.SimpleQueue[Any]") -> None:
        super().__init__(records)
        self._records = records
        self._lost = 0

    def enqueue(self, record: logging.LogRecord) -> None:
        """Queue a record if there is room. Never blocks."""
        if self._records.qsize() >= MOST_WAITING:
            self._lost += 1
            return
        record.lines_lost, self._lost = self._lost, 0
        self._records.put_nowait(record)

    def prepare(self, record: logging.LogRecord) -> logging.LogRecord:
        record.valve = _VALVE.get()
        return record


class _Lines(logging.StreamHandler[TextIO]):
    """Writes lines. One that finds no room, on a full disk, say, comes later, as far as standard error keeps it."""

    def handleError(self, record: logging.LogRecord) -> None:  # noqa: N802
        """Add nothing to the lines that is no line: a traceback of each would stand among them later."""


class LogListener(QueueListener):
    """Writes the queue's records; a standard error that nobody reads holds up nobody else."""

    def is_alive(self) -> bool:
        """Return whether its thread runs."""
        thread: Thread | None = self._thread
        return thread is not None and thread.is_alive()

    def stop(self) -> None:
        """Write what waits, and end; give it up after `FLUSH_S`."""
        self.enqueue_sentinel()
        if self._thread is not None:
            self._thread.join(FLUSH_S)
            self._thread = None


def start_logging(level: str) -> LogListener:
    """Send everything of this level and above to standard error; stop the listener to flush it."""
    handler = _Lines(sys.stderr)
    handler.setFormatter(JsonLines())
    records: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
    listener = LogListener(records, handler)
    logging.basicConfig(level=level.upper(), handlers=[_Unformatted(records)], force=True)
    listener.start()
    return listener

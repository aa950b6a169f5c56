"""Structured logs: one JSON object a line on standard error, written by a thread of its own.

A cycle that says something puts it into a queue; the queue's thread formats and writes.
"""

import json
import logging
import queue
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from datetime import UTC, datetime
from logging.handlers import QueueHandler, QueueListener

_VALVE: ContextVar[str | None] = ContextVar("valve", default=None)


@contextmanager
def logging_valve(valve: str | None) -> Iterator[None]:
    """Have every line that this thread logs in the meantime name a valve."""
    token = _VALVE.set(valve)
    try:
        yield
    finally:
        _VALVE.reset(token)


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
        }
        if record.exc_info:
            line["exception"] = self.formatException(record.exc_info)
        return json.dumps(line, default=str)


class _Unformatted(QueueHandler):
    """Hands records over as they are, so that the thread that logs does no formatting; notes the valve in them."""

    def prepare(self, record: logging.LogRecord) -> logging.LogRecord:
        record.valve = _VALVE.get()
        return record


def start_logging(level: str) -> QueueListener:
    """Send everything of this level and above to standard error; stop the listener to flush it."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(JsonLines())
    records: queue.SimpleQueue[logging.LogRecord] = queue.SimpleQueue()
    listener = QueueListener(records, handler)
    logging.basicConfig(level=level.upper(), handlers=[_Unformatted(records)], force=True)
    listener.start()
    return listener

"""The log: bounded in memory, and what is lost is counted."""

import io
import json
import logging
import math
import sys
import threading
import time
from threading import Event

import pytest

from positioner.daemon import logs
from positioner.daemon.backoff import LinesPerPeer
from positioner.daemon.logs import JsonLines, log_event, start_logging

log = logging.getLogger("test")


class Pipe(io.StringIO):
    """A standard error whose reader has stopped."""

    def __init__(self) -> None:
        super().__init__()
        self.read_on = Event()

    def write(self, text: str) -> int:
        self.read_on.wait(60.0)
        return super().write(text)


def test_a_line_is_json_whatever_number_is_in_it() -> None:
    record = logging.LogRecord("test", logging.INFO, "", 0, "health", (), None)
    record.fields = {"friction_ratio": math.nan, "beyond": [math.inf, 1.0], "each": {"a": -math.inf}, "state": object}

    def refused(constant: str) -> None:
        raise AssertionError(constant)

    said = json.loads(JsonLines().format(record), parse_constant=refused)
    assert (said["friction_ratio"], said["beyond"], said["each"]) == (None, [None, 1.0], {"a": None})


@pytest.mark.usefixtures("root_logging")
def test_a_log_that_nobody_reads_is_bounded_and_says_what_it_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(logs, "MOST_WAITING", 100)
    monkeypatch.setattr(logs, "FLUSH_S", 0.2)
    pipe = Pipe()
    monkeypatch.setattr(sys, "stderr", pipe)
    before = set(threading.enumerate())
    listener = start_logging("info")
    (thread,) = set(threading.enumerate()) - before
    for number in range(10_000):
        log_event(log, logging.INFO, "write refused", number=number)
    start_s = time.monotonic()
    listener.stop()
    assert time.monotonic() - start_s < 30.0, "it does not wait for a reader that stopped"
    pipe.read_on.set()
    thread.join(30.0)
    listener.start()
    log_event(log, logging.INFO, "on")
    listener.stop()
    lines = [json.loads(line) for line in pipe.getvalue().splitlines()]
    written = [line for line in lines if line["event"] == "write refused"]
    assert sum(line.get("lines_lost", 0) for line in lines) == 10_000 - len(written)
    assert lines[-1]["lines_lost"] > 0
    assert len(written) < 1000


def test_a_host_that_writes_what_is_refused_causes_a_few_lines_and_others_keep_theirs() -> None:
    """3.5 MB a second came of one client's refused writes."""
    lines = LinesPerPeer()
    said = [lines.unsaid(f"10.0.0.9:{40_000 + number % 50}", number * 1e-4) for number in range(100_000)]
    assert sum(each is not None for each in said) == pytest.approx(LinesPerPeer.AT_ONCE + 20, abs=1)
    assert lines.unsaid("10.0.0.7:5", 10.0) == 0
    assert lines.unsaid("anna (operator) at 10.0.0.9:7", 11.0) == pytest.approx(100_000 / 20, rel=0.2), "the same host"

"""Tests begun by who watches: consent for as long as they last, one at a time, broken off by ending the command."""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from config.daemon_file import DaemonFile
from config.roles import Role
from northbound.observer import valve_tests
from northbound.observer.valve_commands import Confirmation
from northbound.observer.valve_tests import ValveTests
from northbound.observer.watched_valves import Place

SITE = DaemonFile.model_validate({"valve": {"name": "FV-1", "stroke_m": 0.04}, "recorder": {"folder": "recordings"}})
PASSES = "print('1 of 1: partial stroke, 3 s'); print('partial stroke test of FV-1: passed'); print('kept')"
WAITS = """
import signal, sys, time
signal.signal(signal.SIGTERM, lambda *_: sys.exit('broken off; the law commands the valve again'))
print('under way', flush=True)
time.sleep(60.0)
"""


class Registers:
    """In place of a connection to the daemon."""

    def __init__(self, consent: float) -> None:
        self.values, self.written = {"experiment_consent": consent}, list[float]()

    def __enter__(self) -> "Registers":
        return self

    def __exit__(self, *_: object) -> None: ...

    def get(self, name: str) -> float:
        return self.values[name]

    def set(self, name: str, value: float) -> None:
        self.values[name] = value
        self.written.append(value)

    def set_and_read_back(self, name: str, value: float) -> None:
        self.set(name, value)


def panel(monkeypatch: pytest.MonkeyPatch, script: str, consent: float = 0.0) -> tuple[ValveTests, Registers]:
    registers = Registers(consent)
    monkeypatch.setattr(Place, "connection", lambda *_: registers)
    monkeypatch.setattr(valve_tests, "COMMAND", (sys.executable, "-c", script))
    return ValveTests(Place("FV-1", "localhost", 5502, 1, settings=SITE, file=Path("site.toml"))), registers


def begun(tests: ValveTests, show: Callable[[str], None] = lambda _: None, **other: Any) -> Confirmation:
    asked: dict[str, Any] = {"role": Role.ENGINEER, "test": "partial stroke", "kind": "as_left", "show": show}
    return tests.run(**asked | other)


@pytest.mark.parametrize(("consent", "written"), [(0.0, [1.0, 0.0]), (1.0, [])])
def test_consent_lasts_as_long_as_the_test_or_as_it_did(
    consent: float, written: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    tests, registers = panel(monkeypatch, PASSES, consent)
    assert begun(tests) == Confirmation(True, "partial stroke test of FV-1: passed")
    assert registers.written == written


def test_one_at_a_time_and_broken_off_by_whoever_began_it(monkeypatch: pytest.MonkeyPatch) -> None:
    tests, registers = panel(monkeypatch, WAITS)
    said, found = list[str](), list[Confirmation]()
    under_way = Thread(target=lambda: found.append(begun(tests, said.append)))
    under_way.start()
    due_s = time.monotonic() + 60.0
    while not said and time.monotonic() < due_s:
        time.sleep(0.01)
    assert begun(tests) == Confirmation(False, "a test is under way already")
    tests.end()
    under_way.join(60.0)
    assert found == [Confirmation(False, "broken off; the law commands the valve again")]
    assert registers.values["experiment_consent"] == 0.0


def test_who_may_not_consent_or_has_no_file_is_told_so(monkeypatch: pytest.MonkeyPatch) -> None:
    tests, registers = panel(monkeypatch, PASSES)
    assert begun(tests, role=Role.OPERATOR) == Confirmation(False, "a test on the valve needs the role engineer")
    assert "needs the daemon's file" in begun(ValveTests(Place("FV-1", "localhost", 5502, 1))).text
    assert registers.written == []

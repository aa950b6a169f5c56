"""One thread keeps for all: each is looked at in turn, the end is at once, and what goes wrong ends the daemon."""

import threading
from threading import Event

import pytest

from positioner.daemon import keeping_thread
from positioner.daemon.keeping_thread import Keeping

WITHIN_S = 30.0


class Looked:
    """A keeper that notes who was looked at, and tells when that was often enough."""

    def __init__(self, name: str, order: list[str], often: Event) -> None:
        self.valve, self.order, self.often = name, order, often

    def check(self) -> None:
        self.order.append(self.valve)
        if len(self.order) >= 9:
            self.often.set()


def test_all_are_looked_at_in_turn_by_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keeping_thread, "EVERY_S", 1e-3)
    order: list[str] = []
    often, before = Event(), threading.active_count()
    one = Keeping([Looked(name, order, often) for name in "abc"])
    one.start()
    assert threading.active_count() == before + 1
    assert often.wait(WITHIN_S)
    one.stop()
    assert order[:9] == list("abcabcabc")
    assert threading.active_count() == before


def test_it_ends_at_once_however_long_it_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(keeping_thread, "EVERY_S", 1e6)
    before = threading.active_count()
    one = Keeping([Looked("a", [], Event())])
    one.start()
    one.stop()
    assert threading.active_count() == before


def test_what_a_look_raises_is_the_death_of_the_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """As `positioner.daemon.end_signals` takes it: the daemon ends."""
    monkeypatch.setattr(keeping_thread, "EVERY_S", 1e-3)
    died: list[str] = []
    told = Event()

    def note(args: threading.ExceptHookArgs) -> None:
        died.append(str(args.exc_value))
        told.set()

    monkeypatch.setattr(threading, "excepthook", note)

    class Broken:
        valve = "a"

        def check(self) -> None:
            raise OverflowError("too large")

    one = Keeping([Broken()])
    one.start()
    assert told.wait(WITHIN_S)
    one.stop()
    assert died == ["too large"]

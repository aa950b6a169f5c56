"""What has happened to a valve, as an observer is told it."""

from pathlib import Path

from config.codes import EventKind, Fault, Mode, Ne107Status
from northbound.observer.valve_events import (
    AS_SERVED,
    FROM_HISTORY,
    SeenEvent,
    put_in_words,
    read_event,
    what_happened,
)
from northbound.observer.valve_view import ValveView
from positioner.history import HistoryFile
from positioner.history.entries import Event

FAULT = Event("FV-101", 1, 1e9, EventKind.FAULT, "FAULT", Ne107Status.FAILURE, Fault.NO_REPLY, "no reply")
MODE = Event("FV-101", 2, 1e9 + 60, EventKind.MODE, "MODE", Ne107Status.GOOD, Mode.AUTOMATIC, "automatic")
STARTED = Event("FV-101", 3, 1e9 + 80, EventKind.STARTED, "STARTED", Ne107Status.GOOD, 0, "")
SERVED = {"event_number": 2.0, "event": 7.0, "event_class": 0.0, "event_cause": 2.0, "event_time": 1e9 + 60}


def told(folder: Path | None, *served: Event) -> list[tuple[str, str]]:
    return [(each.text, each.ne107) for each in what_happened(folder, "FV-101", served, (), 0.0, 5).lines]


def test_a_history_tells_all_newest_first_and_only_of_this_valve(tmp_path: Path) -> None:
    other = Event("FV-102", 1, 1e9, EventKind.STARTED, "STARTED", Ne107Status.GOOD, 0, "")
    file = HistoryFile(tmp_path, 1e4, 10)
    file.append([FAULT, other, MODE])
    try:
        assert what_happened(tmp_path, "FV-101", (), (), 0.0, 5).source == FROM_HISTORY
        assert told(tmp_path, MODE) == [
            ("the mode has changed: automatic", ""),
            ("a fault is latched: no reply", "F failure"),
        ]
    finally:
        file.close()


def test_each_thing_is_told_once_the_connection_as_seen(tmp_path: Path) -> None:
    """The mode was told by the history, and again as seen."""
    seen = (SeenEvent(70.0, "connection lost: no reply", True), SeenEvent(60.0, "mode: hold -> automatic"))
    file = HistoryFile(tmp_path, 1e4, 10)
    file.append([FAULT, MODE])
    try:
        by_history = what_happened(tmp_path, "FV-101", (FAULT, MODE), seen, 1e9, 5)
    finally:
        file.close()
    lost = "connection lost: no reply"
    assert [each.text for each in by_history.lines] == [
        lost,
        "the mode has changed: automatic",
        "a fault is latched: no reply",
    ]
    as_seen = what_happened(tmp_path / "gone", "FV-101", (FAULT, MODE, STARTED), seen, 1e9, 5)
    assert [each.text for each in as_seen.lines] == ["the daemon started", lost, "mode: hold -> automatic"]
    assert as_seen.source.startswith(AS_SERVED)
    assert "No such file" in as_seen.source


def test_what_its_class_is_is_told_with_its_cause_and_once() -> None:
    values = {"event_number": 4.0, "event_time": 1e9, "event": float(EventKind.EXCITATION_ENDED)}
    ended = read_event("FV-101", values | {"event_class": 0.0, "event_cause": 0.0})
    assert ended is not None
    assert told(None, ended) == [("the excitation has ended", "")]
    health = Event("FV-101", 5, 1e9, EventKind.HEALTH, "HEALTH", Ne107Status.FUNCTION_CHECK, 1, "not automatic")
    assert put_in_words(health).text == "NE 107: C check, not automatic"
    good = Event("FV-101", 6, 1e9, EventKind.HEALTH, "HEALTH", Ne107Status.GOOD, 0, "")
    assert (put_in_words(good).text, put_in_words(good).ne107) == ("NE 107: good", "")


def test_events_that_came_between_two_readings_are_counted() -> None:
    fourth = Event("FV-101", 4, 1e9 + 90, EventKind.MODE, "MODE", Ne107Status.GOOD, Mode.HOLD, "hold")
    assert [text for text, _ in told(None, FAULT, fourth)] == ["2 events before this, which were not read"]


def test_an_event_over_the_bus_is_the_one_of_the_history() -> None:
    assert read_event("FV-101", SERVED) == MODE
    assert read_event("FV-101", SERVED | {"event_number": 0.0}) is None
    assert read_event("FV-101", {}) is None
    strange = read_event("FV-101", SERVED | {"event": 99.0})
    assert strange is not None
    assert strange.words == "event 99"


def test_a_view_keeps_each_event_once() -> None:
    view = ValveView("FV-101", 0.1, 0.05)
    for time_s in (0.0, 1.0, 2.0):
        view.take(time_s, SERVED)
    view.take(3.0, SERVED | {"event_number": 3.0})
    assert [each.number for each in view.at(3.0).served] == [2, 3]

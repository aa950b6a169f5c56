"""What has happened to a valve, as an observer is told it."""

from pathlib import Path

from config.codes import EventKind, Fault, Mode, Ne107Status
from positioner.history import HistoryFile
from positioner.history.entries import Event
from positioner.observer.happened import AS_SERVED, FROM_HISTORY, served_event, what_happened
from positioner.observer.valve_view import ValveView

FAULT = Event("FV-101", 1, 1e9, EventKind.FAULT, "FAULT", Ne107Status.FAILURE, Fault.NO_REPLY, "no reply")
MODE = Event("FV-101", 2, 1e9 + 60, EventKind.MODE, "MODE", Ne107Status.GOOD, Mode.AUTOMATIC, "automatic")
SERVED = {"event_number": 2.0, "event": 7.0, "event_class": 0.0, "event_cause": 2.0, "event_time": 1e9 + 60}


def told(folder: Path | None, *served: Event) -> list[tuple[str, str]]:
    return [(each.text, each.ne107) for each in what_happened(folder, "FV-101", served, 5).lines]


def test_a_history_tells_all_newest_first_and_only_of_this_valve(tmp_path: Path) -> None:
    other = Event("FV-102", 1, 1e9, EventKind.STARTED, "STARTED", Ne107Status.GOOD, 0, "")
    file = HistoryFile(tmp_path, 1e4, 10)
    file.append([FAULT, other, MODE])
    try:
        assert what_happened(tmp_path, "FV-101", (), 5).source == FROM_HISTORY
        assert told(tmp_path, MODE) == [
            ("the mode has changed: automatic", ""),
            ("a fault is latched: no reply", "F failure"),
        ]
    finally:
        file.close()


def test_without_one_the_newest_as_served_are_told_and_why(tmp_path: Path) -> None:
    assert told(None, FAULT, MODE) == [
        ("the mode has changed: automatic", ""),
        ("a fault is latched: no reply", "F failure"),
    ]
    assert what_happened(None, "FV-101", (), 5).source == AS_SERVED
    gone = what_happened(tmp_path / "gone", "FV-101", (MODE,), 5)
    assert gone.source.startswith(AS_SERVED)
    assert "No such file" in gone.source
    assert len(gone.lines) == 1


def test_of_an_event_without_a_cause_no_cause_is_told() -> None:
    values = {"event_number": 4.0, "event_time": 1e9, "event_class": 0.0, "event_cause": 0.0}
    ended = served_event("FV-101", values | {"event": float(EventKind.EXCITATION_ENDED)})
    held = served_event("FV-101", values | {"event": float(EventKind.MODE)})
    assert told(None, *filter(None, (ended,))) == [("the excitation has ended", "")]
    assert told(None, *filter(None, (held,))) == [("the mode has changed: hold", "")]


def test_events_that_came_between_two_readings_are_counted() -> None:
    fourth = Event("FV-101", 4, 1e9 + 90, EventKind.MODE, "MODE", Ne107Status.GOOD, Mode.HOLD, "hold")
    assert [text for text, _ in told(None, FAULT, fourth)][1] == "2 events more, which were not read"


def test_an_event_over_the_bus_is_the_one_of_the_history() -> None:
    assert served_event("FV-101", SERVED) == MODE
    assert served_event("FV-101", SERVED | {"event_number": 0.0}) is None
    assert served_event("FV-101", {}) is None
    strange = served_event("FV-101", SERVED | {"event": 99.0})
    assert strange is not None
    assert strange.words == "event 99"


def test_a_view_keeps_each_event_once() -> None:
    view = ValveView("FV-101", 0.1, 0.05)
    for time_s in (0.0, 1.0, 2.0):
        view.take(time_s, SERVED)
    view.take(3.0, SERVED | {"event_number": 3.0})
    assert [each.number for each in view.at(3.0).served] == [2, 3]

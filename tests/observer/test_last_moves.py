"""The last minutes as a recording: of the recorder's file where there is one, else of what was polled."""

import time
from pathlib import Path

import numpy as np
import pytest

from config.recorder_files import COLUMNS
from northbound.observer.last_moves import last_moves, read_tail
from northbound.observer.valve_view import ValveView
from positioner.daemon.recorder import Recorder

RATE_HZ = 200


def recorded(folder: Path, seconds: float) -> None:
    """Record a stem that follows a step of its reference, from 40 to 60 mm at half time, with a lag of 0.1 s."""
    recorder = Recorder(folder, "FV-101", 10_000_000, 3)
    recorder.start()
    for row in range(round(seconds * RATE_HZ)):
        time_s = row / RATE_HZ
        since_s = time_s - seconds / 2
        moved = 0.02 * (1 - np.exp(-since_s / 0.1)) if since_s >= 0 else 0.0
        recorder.offer((time_s, 24e3, 0.04 + float(moved), 24e3, 0.06 if since_s >= 0 else 0.04, 1, 0))
    recorder.stop()


def test_the_response_of_the_last_moves_comes_from_the_recording(tmp_path: Path) -> None:
    recorded(tmp_path, 8.0)
    moves = last_moves(ValveView("FV-101", 0.1, 0.05), 0.0, 6.0, tmp_path, time.time())
    assert moves is not None
    assert moves.source == "the daemon's recording, at its full rate"
    assert moves.recording.time_s[0] == pytest.approx(2.0, abs=0.01)
    (step,) = moves.response.steps
    assert step.t63_s.value == pytest.approx(0.1, abs=0.01)


def test_a_torn_line_and_a_folder_of_others_are_no_error(tmp_path: Path) -> None:
    recorded(tmp_path, 1.0)
    (file,) = tmp_path.glob("*.csv")
    with file.open("a") as opened:
        opened.write("1.0,24000.0,0.0")
    tail = read_tail(tmp_path, "FV-101", 10.0, time.time())
    assert tail is not None
    assert (len(tail), tuple(tail.columns)) == (RATE_HZ, COLUMNS)
    assert read_tail(tmp_path, "FV-102", 10.0, time.time()) is None
    assert read_tail(tmp_path / "nowhere", "FV-101", 10.0, time.time()) is None


def test_a_recording_that_is_not_written_any_more_is_not_of_the_last_minutes(tmp_path: Path) -> None:
    recorded(tmp_path, 1.0)
    assert read_tail(tmp_path, "FV-101", 10.0, time.time() + 5.0) is not None
    assert read_tail(tmp_path, "FV-101", 10.0, time.time() + 15.0) is None


def test_without_a_recording_what_was_polled_takes_its_place() -> None:
    view = ValveView("FV-101", 0.1, 0.05)
    assert last_moves(view, 0.0, 60.0, None, 0.0) is None
    for poll in range(200):
        asked, there = (0.6 if poll >= since else 0.4 for since in (100, 103))
        said = {"position_m": 0.1 * there, "reference_in_force": asked, "command": 24e3, "pressure": 24e3}
        view.take(0.05 * poll, said | {"state": 1.0, "sample_age": 0.0, "cycles": 50.0 * poll})
    view.lose(10.0, "away")
    moves = last_moves(view, 10.0, 60.0, None, 0.0)
    assert moves is not None
    assert moves.source.startswith("as polled")
    assert len(moves.recording) == 200
    assert [round(step.size, 4) for step in moves.response.steps] == [0.02]

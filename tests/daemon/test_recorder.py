"""The recorder: every row, whole lines, bounded in files and in memory."""

import os
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import read_recording
from config.valve_file import load_valve, shipped_valve
from positioner.daemon import recorder as room
from positioner.daemon.recorder import Recorder, Row
from workbench.report import Subject


def row(index: int) -> Row:
    return (index * 1e-3, 44e3 + index / 3, 0.05, 44e3, 0.06, 1, 0)


def recorded(folder: Path, rows: int, file_bytes: int = 10_000_000, keep_files: int = 5) -> Recorder:
    recorder = Recorder(folder, "FV 101/a", file_bytes, keep_files)
    recorder.start()
    for index in range(rows):
        recorder.offer(row(index))
    recorder.stop()
    return recorder


def test_what_is_offered_is_what_is_read_bit_by_bit(tmp_path: Path) -> None:
    recorded(tmp_path, 1000)
    (path,) = tmp_path.iterdir()
    assert path.name.startswith("FV-101-a-")
    recording = read_recording(path)
    np.testing.assert_array_equal(recording.time_s, [index * 1e-3 for index in range(1000)])
    np.testing.assert_array_equal(recording.command_pa, [44e3 + index / 3 for index in range(1000)])


def test_a_file_says_when_it_was_recorded_as_a_report_shows_it(tmp_path: Path) -> None:
    before = datetime.now(UTC).replace(microsecond=0)
    recorded(tmp_path, 1)
    (path,) = tmp_path.iterdir()
    said = Subject(load_valve(shipped_valve("seed")), (), read_recording(path).metadata).recorded
    assert before <= datetime.fromisoformat(said) <= datetime.now(UTC)


def test_full_files_are_followed_and_the_oldest_deleted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "WRITE_EVERY_S", 0.0)
    recorder = Recorder(tmp_path, "v", 2000, 3)
    recorder.start()
    for index in range(400):
        recorder.offer(row(index))
        while recorder.waiting:
            os.sched_yield()
    recorder.stop()
    files = sorted(tmp_path.iterdir())
    assert len(files) == 3
    assert all(path.stat().st_size < 2200 for path in files)
    assert read_recording(files[-1]).time_s[-1] == 0.399


def test_a_row_without_room_is_counted_and_the_next_one_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "MOST_WAITING", 10)
    recorder = Recorder(tmp_path, "v", 100_000, 3)
    for index in range(15):
        recorder.offer(row(index))
    assert recorder.unrecorded == 5
    recorder.start()
    while recorder.waiting:
        os.sched_yield()
    recorder.offer(row(15))
    recorder.stop()
    (path,) = tmp_path.iterdir()
    assert read_recording(path).columns["unrecorded"].tolist() == [0.0] * 10 + [5.0]


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="recordings cannot be written there: Not a directory"):
        Recorder(tmp_path / "file" / "folder", "v", 100_000, 3).start()

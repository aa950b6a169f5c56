"""The recorder: every row, whole lines, bounded in files and in memory."""

import errno
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


def fill(recorder: Recorder, first: int, rows: int) -> None:
    for index in range(first, first + rows):
        recorder.offer(row(index))
        while recorder.waiting:
            os.sched_yield()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_older_files_with_a_later_stamp_do_not_cost_the_file_that_is_written(tmp_path: Path) -> None:
    """The clock was set back."""
    for number in (1, 2, 3):
        (tmp_path / f"v-20990101T000000Z-000{number}.csv").write_text("time_s\n")
    recorder = Recorder(tmp_path, "v", 10_000, 2)
    recorder.start()
    fill(recorder, 0, 10)
    recorder.stop()
    kept = names(tmp_path)
    assert [name.rpartition("-")[2] for name in kept] == ["0004.csv", "0003.csv"]
    assert len(read_recording(tmp_path / kept[0])) == 10
    assert [path.name for path in room.files_of(tmp_path, "v")] == kept[::-1], "oldest first, by their numbers"


@pytest.mark.parametrize("failing", ["open", "write"])
def test_a_rotation_that_fails_goes_on_in_the_old_file_and_is_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    monkeypatch.setattr(room, "WRITE_EVERY_S", 0.0)
    recorder = Recorder(tmp_path, "v", 2000, 5)
    recorder.start()
    real = getattr(os, failing)

    def fail(*arguments: object) -> object:
        if failing == "open" or bytes(arguments[1]).startswith(b"# valve"):  # type: ignore[call-overload]
            raise OSError(errno.ENOSPC, "No space left on device")
        return real(*arguments)

    with monkeypatch.context() as full:
        full.setattr(os, failing, fail)
        fill(recorder, 0, 100)
    assert len(names(tmp_path)) == 1
    fill(recorder, 100, 100)
    recorder.stop()
    files = room.files_of(tmp_path, "v")
    assert len(files) > 1
    times_s = [time_s for path in files for time_s in read_recording(path).time_s]
    assert times_s == pytest.approx([index * 1e-3 for index in range(200)]), "no row is lost"


def test_valves_of_like_names_and_starts_within_a_second_do_not_meet(tmp_path: Path) -> None:
    valves = ["FV 1", "FV-1", "FV/1", "阀门一", "阀门二"]
    for valve in valves * 2:
        recorder = Recorder(tmp_path, valve, 10_000, 5)
        recorder.start()
        fill(recorder, 0, 1)
        recorder.stop()
    assert len(names(tmp_path)) == 10
    assert [len(room.files_of(tmp_path, valve)) for valve in valves] == [2] * 5
    assert read_recording(room.files_of(tmp_path, "阀门一")[0]).metadata["valve"] == "阀门一"


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

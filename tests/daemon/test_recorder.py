"""The recorder: every row, whole lines, bounded in files and in memory."""

import errno
import gzip
import os
import random
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext, suppress
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from config import recording
from config.errors import InputError
from config.recorder_files import files_of
from config.recording import read_recording
from config.valve_file import load_valve, shipped_valve
from positioner.daemon import recorder as room
from positioner.daemon import recording_compression
from positioner.daemon.recorder import Recorder, Row
from positioner.daemon.recording_compression import compress
from tests.history.test_history_file import full_above
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
            time.sleep(1e-4)  # a wait that spins would take the processor from who writes
    recorder.stop()
    files = sorted(tmp_path.iterdir())
    assert len(files) == 3
    assert all(path.stat().st_size < 2200 for path in files)
    assert read_recording(files[-1]).time_s[-1] == 0.399


def fill(recorder: Recorder, first: int, rows: int) -> None:
    for index in range(first, first + rows):
        recorder.offer(row(index))
        while recorder.waiting:
            time.sleep(1e-4)  # a wait that spins would take the processor from who writes


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_older_files_with_a_later_stamp_do_not_cost_the_file_that_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The clock was set back."""
    monkeypatch.setattr(room, "WRITE_EVERY_S", 0.0)
    for number in (1, 2, 3):
        (tmp_path / f"v-20990101T000000Z-000{number}.csv").write_text("time_s\n")
    recorder = Recorder(tmp_path, "v", 10_000, 2)
    recorder.start()
    fill(recorder, 0, 10)
    recorder.stop()
    kept = names(tmp_path)
    assert [name.rpartition("-")[2] for name in kept] == ["0004.csv", "0003.csv"]
    assert len(read_recording(tmp_path / kept[0])) == 10
    assert [path.name for path in files_of(tmp_path, "v")] == kept[::-1], "oldest first, by their numbers"


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
    files = files_of(tmp_path, "v")
    assert len(files) > 1
    times_s = [time_s for path in files for time_s in read_recording(path).time_s]
    assert times_s == pytest.approx([index * 1e-3 for index in range(200)]), "no row is lost"


def test_rows_that_a_full_disk_still_keeps_out_at_the_end_are_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """They were lost without a word: `unrecorded` counts those that found no place in the queue."""
    recorder = Recorder(tmp_path, "v", 10_000, 5)
    recorder.start()
    with full_above(0):
        for index in range(7):
            recorder.offer(row(index))
        recorder.stop()
    lost = caplog.records[-1]
    assert (lost.getMessage(), lost.fields["rows"]) == ("the end of the recording is lost", 7)  # type: ignore[attr-defined]


def test_valves_of_like_names_and_starts_within_a_second_do_not_meet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(room, "WRITE_EVERY_S", 0.0)
    valves = ["FV 1", "FV-1", "FV/1", "阀门一", "阀门二"]
    for valve in valves * 2:
        recorder = Recorder(tmp_path, valve, 10_000, 5)
        recorder.start()
        fill(recorder, 0, 1)
        recorder.stop()
    assert len(names(tmp_path)) == 10
    assert [len(files_of(tmp_path, valve)) for valve in valves] == [2] * 5
    assert read_recording(files_of(tmp_path, "阀门一")[0]).metadata["valve"] == "阀门一"


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
        time.sleep(1e-4)
    recorder.offer(row(15))
    recorder.stop()
    (path,) = tmp_path.iterdir()
    assert read_recording(path).columns["unrecorded"].tolist() == [0.0] * 10 + [5.0]


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="recordings cannot be written there: Not a directory"):
        Recorder(tmp_path / "file" / "folder", "v", 100_000, 3).start()


# ---- a new file by age, and compressed ones


class Hours:
    """The module time, with hours that pass when the test says."""

    def __init__(self) -> None:
        self.now_s = 0.0

    def monotonic(self) -> float:
        return self.now_s


def test_an_old_file_is_followed_by_a_new_one_and_no_row_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hours = Hours()
    monkeypatch.setattr(room, "time", hours)
    monkeypatch.setattr(room, "WRITE_EVERY_S", 0.0)
    recorder = Recorder(tmp_path, "v", 10_000_000, 10, file_s=3600.0)
    recorder.start()
    for hour in range(4):
        hours.now_s = hour * 3601.0
        fill(recorder, hour * 50, 50)
    recorder.stop()
    files = files_of(tmp_path, "v")
    assert [len(read_recording(path)) for path in files] == [50] * 4
    times_s = [time_s for path in files for time_s in read_recording(path).time_s]
    assert times_s == [index * 1e-3 for index in range(200)]


def compressing(folder: Path, rows: int, keep_files: int = 10) -> None:
    recorder = Recorder(folder, "v", 4_000, keep_files, compress=True)
    recorder.start()
    fill(recorder, 0, rows)
    compression = recorder.compression
    assert compression is not None
    while plain := [path for path in files_of(folder, "v")[:-2] if path.suffix == ".csv"]:
        compression.begin(plain)  # as the next rotation does
        assert compression.process is not None
        compression.process.wait(60)
    if compression.process is not None:
        compression.process.wait(60)  # its last file may be there as both still
    recorder.stop()


@pytest.mark.real_time
def test_closed_files_are_compressed_and_open_as_they_were(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "WRITE_EVERY_S", 0.0)
    compressing(tmp_path, 400)
    files = files_of(tmp_path, "v")
    assert [path.suffix for path in files[-3:]] == [".gz", ".csv", ".csv"]
    assert len(files) == len(names(tmp_path)) > 4, "nothing is there twice, and nothing half done"
    recordings = [read_recording(path) for path in files]
    assert [each.metadata["valve"] for each in recordings] == ["v"] * len(files)
    times_s = [time_s for each in recordings for time_s in each.time_s]
    assert times_s == [index * 1e-3 for index in range(400)], "no row is lost, bit by bit"


@pytest.mark.real_time
def test_compressed_files_count_among_those_that_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "WRITE_EVERY_S", 0.0)
    compressing(tmp_path, 400)
    before = len(files_of(tmp_path, "v"))
    compressing(tmp_path, 400, keep_files=3)
    assert before > 3
    assert len(files_of(tmp_path, "v")) <= 4, "one may have been compressed while it was to be deleted"
    compressing(tmp_path, 1, keep_files=3)
    assert len(files_of(tmp_path, "v")) == len(names(tmp_path)) == 3


def closed(folder: Path) -> Path:
    recorded(folder, 500)
    (path,) = folder.iterdir()
    return path


@pytest.mark.parametrize("failing", ["write", "read back", "rename"])
def test_a_compression_that_fails_leaves_the_plain_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: str
) -> None:
    path = closed(tmp_path)
    content = path.read_bytes()
    with monkeypatch.context() as broken:
        if failing == "read back":
            broken.setattr(recording_compression, "reads_back", lambda *_: False)
        if failing == "rename":
            broken.setattr(Path, "replace", fail_with(errno.EIO))
        with (
            full_above(1000) if failing == "write" else nullcontext(),
            pytest.raises(OSError, match=r"read back|large|error"),
        ):
            compress(path)
    assert names(tmp_path) == [path.name]
    assert path.read_bytes() == content
    compress(path)
    assert gzip.decompress((tmp_path / f"{path.name}.gz").read_bytes()) == content


def fail_with(number: int) -> Callable[..., object]:
    def fail(*_: object) -> object:
        raise OSError(number, os.strerror(number))

    return fail


@pytest.mark.real_time
def test_a_compression_killed_at_any_moment_leaves_the_one_or_the_other_whole(tmp_path: Path) -> None:
    path = closed(tmp_path)
    rows = len(read_recording(path))
    content = path.read_bytes()
    dice = random.Random(5)
    for _ in range(8):
        words = [sys.executable, "-P", "-m", "positioner.daemon.recording_compression", str(path)]
        path.write_bytes(content)
        with subprocess.Popen(words) as child:
            with suppress(subprocess.TimeoutExpired):
                child.wait(dice.uniform(0.02, 0.35))
            child.kill()
        found = files_of(tmp_path, "FV 101/a")
        assert [len(read_recording(each)) for each in found] == [rows]
        for each in tmp_path.glob("*.gz"):
            each.unlink()


def test_a_plain_file_beside_its_whole_twin_is_deleted_at_the_next_start(tmp_path: Path) -> None:
    """As a crash between the renaming and the deletion leaves it."""
    path = closed(tmp_path)
    content = path.read_bytes()
    compress(path)
    path.write_bytes(content)
    assert [each.suffix for each in files_of(tmp_path, "FV 101/a")] == [".gz"]
    recorder = Recorder(tmp_path, "FV 101/a", 10_000_000, 5, compress=True)
    recorder.start()
    recorder.stop()
    assert [name.partition(".")[2] for name in names(tmp_path)] == ["csv.gz", "csv"]


def test_a_torn_or_endless_compressed_file_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = closed(tmp_path)
    compress(path)
    packed = tmp_path / f"{path.name}.gz"
    torn = tmp_path / "torn.csv.gz"
    torn.write_bytes(packed.read_bytes()[:-20])
    with pytest.raises(InputError, match="is not whole"):
        read_recording(torn)
    with pytest.raises(InputError, match="cannot be read: Not a gzipped file"):
        read_recording(Path(shutil.copy(__file__, tmp_path / "none.csv.gz")))
    monkeypatch.setattr(recording, "MOST_CHARACTERS", 1000)
    with pytest.raises(InputError, match="holds more than a recording does"):
        read_recording(packed)

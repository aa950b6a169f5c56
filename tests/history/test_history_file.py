"""The history's file: whole after a kill and on a full disk, bounded, read while written, nobody else's."""

import hashlib
import multiprocessing
import os
import random
import resource
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from math import isnan, nan
from multiprocessing.connection import Connection
from pathlib import Path
from threading import Event as Flag
from threading import Thread

import pytest

from config.codes import EventKind
from config.errors import InputError
from positioner.history import FILE_NAME, HistoryFile, HistoryFull, HistoryReader, history_file
from positioner.history.entries import Event, HealthHour, Setting, Write

BATCH = 5
HOUR = HealthHour("FV 1", 3600, 0, 0.1, 2, 0.5, 3, nan, nan, 4, 5, 6, 7, 8)


def event(number: int, valve: str = "FV 1", time_s: float = 1e9) -> Event:
    return Event(valve, number, time_s + number, int(EventKind.MODE), "MODE", 0, 2, "automatic")


def write(number: int, text: str = "reference = 0.5") -> Write:
    return Write(number, "FV 1", 1e9, 1e9, 1, "write", "127.0.0.1:1", "", "", text)


def opened(folder: Path, keep_days: float = 400.0, limit_mb: int = 100) -> "closing[HistoryFile]":
    return closing(HistoryFile(folder, keep_days, limit_mb))


def size_bytes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.glob(f"{FILE_NAME}*") if not path.name.endswith("-shm"))


def test_what_is_written_is_what_is_read(tmp_path: Path) -> None:
    with opened(tmp_path / "new" / "folder") as file:
        file.append([event(1), write(1), HOUR, Setting("FV 1", "cycle.period_s", "0.001")])
        assert file.newest_event("FV 1") == event(1)
        assert file.newest_event("FV 2") is None
        assert file.settings("FV 1") == {"cycle.period_s": "0.001"}
    with HistoryReader(tmp_path / "new" / "folder") as history:
        assert history.events() == [event(1)]
        ((_, hour),) = history.rows(HealthHour)
        assert isnan(hour.friction_pa)
        assert replace(hour, friction_pa=0.0, friction_baseline_pa=0.0) == replace(
            HOUR, friction_pa=0.0, friction_baseline_pa=0.0
        )


def test_an_hour_is_one_row_however_often_it_is_written(tmp_path: Path) -> None:
    with opened(tmp_path) as file:
        file.append([HOUR])
        file.append([replace(HOUR, travel_m=7.0)])
    with HistoryReader(tmp_path) as history:
        assert [hour.travel_m for _, hour in history.rows(HealthHour)] == [7.0]


def test_the_newest_are_told_oldest_first_and_followed_on(tmp_path: Path) -> None:
    with opened(tmp_path) as file, HistoryReader(tmp_path) as history:
        file.append([event(number) for number in range(1, 10)])
        assert [each.number for each in history.events(limit=3)] == [7, 8, 9]
        assert [each.number for each in history.events(since_s=1e9 + 8)] == [8, 9]
        assert history.events(valve="FV 2") == []
        row = history.rows(Event)[-1][0]
        file.append([event(10)])
        assert [each.number for _, each in history.rows(Event, after_row=row)] == [10]


def write_until_killed(folder: Path, said: Connection) -> None:
    file = HistoryFile(folder, 400.0, 100)
    newest = file.newest_event("FV 1")
    number = newest.number if newest else 0
    said.send(number)
    while True:
        file.append([event(number + each) for each in range(1, BATCH + 1)])
        number += BATCH
        said.send(number)


@pytest.mark.patient
def test_a_writer_killed_at_any_moment_loses_nothing_that_it_said_was_written(tmp_path: Path) -> None:
    dice = random.Random(3)
    forks = multiprocessing.get_context("fork")
    for _ in range(int(os.environ.get("HISTORY_KILLS", "4"))):
        heard, said = forks.Pipe(duplex=False)
        child = forks.Process(target=write_until_killed, args=(tmp_path, said))
        child.start()
        said.close()
        acknowledged = heard.recv()
        for _ in range(dice.randrange(1, 30)):
            acknowledged = heard.recv()
        child.kill()
        child.join()
        while heard.poll():
            try:
                acknowledged = heard.recv()
            except EOFError:
                break
        with opened(tmp_path) as file, HistoryReader(tmp_path) as history:
            assert file.set_aside is None
            numbers = [each.number for each in history.events()]
            assert numbers == list(range(1, len(numbers) + 1))
            assert len(numbers) >= acknowledged
            assert len(numbers) % BATCH == 0, "a batch is there whole or not at all"


@contextmanager
def full_above(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond a size: the system refuses as on a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_full_disk_takes_a_batch_whole_or_not_at_all_and_goes_on_when_there_is_room(tmp_path: Path) -> None:
    with opened(tmp_path) as file, HistoryReader(tmp_path) as history:
        number, refused = 0, False
        with full_above(200_000):
            while not refused:
                try:
                    file.append([event(number + each) for each in range(1, BATCH + 1)])
                    number += BATCH
                except HistoryFull:
                    refused = True
                assert number < 1e5, "it never fills"
            assert [each.number for each in history.events()] == list(range(1, number + 1))
            with pytest.raises(HistoryFull):
                file.append([event(number + each) for each in range(1, 5000)])
        file.append([event(number + 1)])
        assert len(history.events()) == number + 1
    with opened(tmp_path) as file:
        assert file.set_aside is None


def test_it_stays_within_its_size_and_a_flood_pushes_out_its_own_kind(tmp_path: Path) -> None:
    with opened(tmp_path, limit_mb=4) as file, HistoryReader(tmp_path) as history:
        file.append([event(number) for number in range(1, 201)])
        for first in range(1, 40_001, 500):
            file.append([write(number, "x" * 200) for number in range(first, first + 500)])
            file.shrink()
            assert size_bytes(tmp_path) < 4e6
        assert len(history.events()) == 200
        numbers = [each.number for _, each in history.rows(Write)]
        assert numbers[-1] == 40_000
        assert 2_000 < len(numbers) < 20_000
        assert numbers == list(range(numbers[0], 40_001)), "the oldest go first"


def test_a_limit_made_smaller_is_kept_at_the_next_start(tmp_path: Path) -> None:
    with opened(tmp_path) as file:
        file.append([write(number, "x" * 200) for number in range(1, 20_000)])
    assert size_bytes(tmp_path) > 4e6
    with opened(tmp_path, limit_mb=4) as file:
        file.shrink()
    assert size_bytes(tmp_path) < 4e6


def test_what_is_too_old_goes_but_for_the_newest_whatever_the_clock_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(history_file, "ALWAYS_KEPT", 10)
    with opened(tmp_path, keep_days=1.0) as file, HistoryReader(tmp_path) as history:
        file.append([event(number, time_s=1e9 + 3600 * number) for number in range(1, 101)])
        file.expire(1e9 + 3600 * 101)
        assert history.events()[0].number == 77
        file.expire(4e9)
        assert [each.number for each in history.events()] == list(range(91, 101)), "a clock a century ahead"


def test_a_reader_sees_whole_batches_while_they_are_written(tmp_path: Path) -> None:
    stop = Flag()

    def keep_writing() -> None:
        number = 0
        while not stop.is_set():
            file.append([event(number + each) for each in range(1, BATCH + 1)])
            number += BATCH

    with opened(tmp_path) as file, HistoryReader(tmp_path) as history:
        writer = Thread(target=keep_writing)
        writer.start()
        counts = [0]
        while counts[-1] < 50 * BATCH:  # a reader that holds up the writer waits here for ever
            counts.append(len(history.events()))
        stop.set()
        writer.join()
    assert all(count % BATCH == 0 for count in counts)
    assert len(set(counts)) > 2


def said(folder: Path) -> str:
    with pytest.raises(InputError) as refusal:
        HistoryFile(folder, 400.0, 100)
    return str(refusal.value)


@pytest.mark.parametrize("content", [b"", b"[valve]\n", b"SQLite format 3\0"])
def test_another_programs_file_is_refused_and_left_as_it_was(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / FILE_NAME
    path.write_bytes(content)
    assert said(tmp_path) == f"{path}: is not a history of this program"
    assert path.read_bytes() == content
    with pytest.raises(InputError, match="is not a history of this program"):
        HistoryReader(path)


def test_another_programs_database_is_refused(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as other:
        other.execute("CREATE TABLE events (what)")
    assert "is not a history of this program" in said(tmp_path)


@pytest.mark.parametrize("version", [0, 2, 77])
def test_another_version_is_refused_in_one_line(tmp_path: Path, version: int) -> None:
    with opened(tmp_path):
        pass
    with closing(sqlite3.connect(tmp_path / FILE_NAME)) as later:
        later.execute(f"PRAGMA user_version = {version}")
    assert f"is a history of version {version}, allowed is 1; move it away" in said(tmp_path)
    with pytest.raises(InputError, match=f"of version {version}"):
        HistoryReader(tmp_path)


def altered(folder: Path, statement: str) -> bytes:
    """Return the content of a history that somebody changed, no write-ahead log beside it."""
    with opened(folder) as file:
        file.append([event(1)])
    with closing(sqlite3.connect(folder / FILE_NAME)) as other:
        other.execute("PRAGMA journal_mode = DELETE").fetchall()
        other.execute(statement)
        other.commit()
    return (folder / FILE_NAME).read_bytes()


@pytest.mark.parametrize(
    "statement",
    [
        "ALTER TABLE health DROP COLUMN friction_pa",
        "ALTER TABLE events ADD COLUMN colour TEXT",
        "DROP TABLE writes",
        "PRAGMA user_version = 0",
    ],
)
def test_what_is_not_whole_of_this_version_is_refused_and_neither_read_in_part_nor_touched(
    tmp_path: Path, statement: str
) -> None:
    content = altered(tmp_path, statement)
    assert said(tmp_path).endswith("move it away")
    with pytest.raises(InputError, match="move it away"):
        HistoryReader(tmp_path)
    assert (tmp_path / FILE_NAME).read_bytes() == content


def test_two_daemons_do_not_share_a_history(tmp_path: Path) -> None:
    with opened(tmp_path):
        assert said(tmp_path) == f"{tmp_path}: another daemon keeps its history there"
    with opened(tmp_path):
        pass


def test_a_folder_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("")
    assert said(tmp_path / "taken").startswith(f"{tmp_path / 'taken'}: the history cannot be kept there: ")
    if os.geteuid():
        (tmp_path / "locked").mkdir(mode=0o500)
        assert "the history cannot be kept there: Permission denied" in said(tmp_path / "locked")


def test_a_damaged_file_is_set_aside_whole_and_begun_anew(tmp_path: Path) -> None:
    with opened(tmp_path) as file:
        file.append([event(number) for number in range(1, 2000)])
    path = tmp_path / FILE_NAME
    content = bytearray(path.read_bytes())
    names = (f"{FILE_NAME}.unreadable", f"{FILE_NAME}.unreadable2")
    for seed, name in enumerate(names):
        content[8192:12288] = random.Random(seed).randbytes(4096)
        path.write_bytes(content)
        with opened(tmp_path) as file:
            assert file.set_aside is not None
            assert file.set_aside.endswith(f"it is {name} now")
            assert file.newest_event("FV 1") is None
            file.append([event(1)])
        assert (tmp_path / name).read_bytes() == content
    assert len({(tmp_path / name).read_bytes() for name in names}) == 2, "what was put aside before stays"


def test_a_file_whose_columns_names_are_no_text_is_refused(tmp_path: Path) -> None:
    with opened(tmp_path) as file:
        file.append([event(1)])
    path = tmp_path / FILE_NAME
    content = path.read_bytes()
    assert b"over_c_std" in content
    path.write_bytes(content.replace(b"over_c_std", b"\xffver_c_std", 1))
    with pytest.raises(InputError, match="has other tables"), HistoryReader(path):
        pass
    assert "has other tables" in said(tmp_path)


def test_a_crash_while_the_file_is_made_leaves_none(tmp_path: Path) -> None:
    (tmp_path / f"{FILE_NAME}.new").write_bytes(b"SQLite format 3\0 and no more")
    with opened(tmp_path) as file:
        file.append([event(1)])
    assert not (tmp_path / f"{FILE_NAME}.new").exists()


def test_a_copy_of_the_file_and_its_log_can_be_read_elsewhere(tmp_path: Path) -> None:
    """As a backup of a running gateway has them."""
    (tmp_path / "backup").mkdir()
    with opened(tmp_path) as file:
        file.append([event(1)])
        for suffix in ("", "-wal"):
            shutil.copy(tmp_path / f"{FILE_NAME}{suffix}", tmp_path / "backup")
    with HistoryReader(tmp_path / "backup") as history:
        assert history.events() == [event(1)]


def test_a_change_of_the_tables_is_a_new_version() -> None:
    tables = hashlib.sha256("\n".join(history_file.schema()).encode()).hexdigest()[:16]
    assert (history_file.VERSION, tables) == (1, "0f8b02170089dee2"), "raise VERSION, and then this"

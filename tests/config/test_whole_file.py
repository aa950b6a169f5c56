"""What is written over is whole, the old or the new, also where a disk is full."""

import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Recording, write_recording
from config.valve_file import load_valve, shipped_valve
from config.valve_file_writer import write_valve
from config.whole_file import beside, filling

ROOM_BYTES = 64


@contextmanager
def full_disk() -> Iterator[None]:
    """No file of this process grows beyond a few bytes, that which pytest may write to among them."""
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM_BYTES, usual[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)


def test_a_full_disk_leaves_the_file_that_was_there(tmp_path: Path) -> None:
    rows = np.arange(100.0)
    valve, recording = tmp_path / "v.toml", tmp_path / "r.csv"
    for path in (valve, recording):
        path.write_text("the old one")
    with full_disk(), pytest.raises(InputError, match=r"v.toml: cannot be written: "):
        write_valve(valve, load_valve(shipped_valve("seed")))
    with full_disk(), pytest.raises(InputError, match=r"r.csv: cannot be written: "):
        write_recording(recording, Recording({"time_s": rows, "command_pa": rows, "position_m": rows}))
    assert [path.read_text() for path in (valve, recording)] == ["the old one", "the old one"]
    assert sorted(tmp_path.iterdir()) == [recording, valve]


def test_what_is_half_done_has_no_name(tmp_path: Path) -> None:
    path = tmp_path / "file"

    def broken_off() -> None:
        with beside(path) as new:
            new.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        broken_off()
    assert list(tmp_path.iterdir()) == []


def test_of_a_link_what_it_points_to_is_replaced_and_may_be_read_by_whom_it_was(tmp_path: Path) -> None:
    target, link = tmp_path / "target", tmp_path / "link"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to("target")
    with beside(link) as new:
        new.write_text("new")
    assert link.is_symlink()
    assert (target.read_text(), target.stat().st_mode & 0o777) == ("new", 0o640)


def test_a_pipe_or_a_device_is_written_itself(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/null")):
        with beside(path) as new:
            assert new == path
    assert pipe.is_fifo()


def test_a_folder_is_filled_whole_or_not_at_all(tmp_path: Path) -> None:
    folder = tmp_path / "new" / "folder"

    def filled(text: str) -> None:
        with filling(folder) as new:
            for name in ("a", "b"):
                (new / name).write_text(name if name == "a" else text)

    with full_disk(), pytest.raises(OSError, match="too large"):
        filled("b" * (ROOM_BYTES + 1))
    assert list(tmp_path.iterdir()) == []
    filled("b")
    assert sorted(each.name for each in folder.iterdir()) == ["a", "b"]
    with pytest.raises(FileExistsError):
        filled("c")
    assert [each.read_text() for each in sorted(folder.iterdir())] == ["a", "b"]

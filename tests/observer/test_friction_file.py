"""The friction that a page has seen outlives it."""

import math
from pathlib import Path

import pytest

from config.errors import InputError
from northbound.observer.friction_file import FrictionFile
from northbound.observer.valve_view import ValveView


def readings(friction_pa: float) -> dict[str, float]:
    return {"friction": friction_pa, "friction_baseline": 5000.0}


def test_what_one_has_seen_the_next_one_shows(tmp_path: Path) -> None:
    file = FrictionFile(tmp_path / "kept", "FV-101/a", 100)
    first = ValveView("FV-101/a", 0.1, 0.05, keep=lambda row: file.append((1e9 + row[0], *row[1:])))
    for minute in range(3):
        first.take(60.0 * minute, readings(6000.0 + minute))
        first.take(60.0 * minute + 30.0, readings(9000.0))
    again = FrictionFile(tmp_path / "kept", "FV-101/a", 100)
    assert [row[0] for row in again.rows] == [1e9, 1e9 + 60.0, 1e9 + 120.0]
    second = ValveView("FV-101/a", 0.1, 0.05, seen=[(row[0] - 2e9, *row[1:]) for row in again.rows])
    second.take(5.0, readings(6100.0))
    assert [row[1] for row in second.friction] == [6000.0, 6001.0, 6002.0, 6100.0]


def test_a_torn_line_is_left_out_and_the_oldest_rows_too(tmp_path: Path) -> None:
    file = FrictionFile(tmp_path, "a", 3)
    for i in range(5):
        file.append((60.0 * i, 1.0, math.nan))
    with file.path.open("a") as torn:
        torn.write("300,1")
    again = FrictionFile(tmp_path, "a", 3)
    assert [row[0] for row in again.rows] == [120.0, 180.0, 240.0]
    again.append((300.0, 2.0, 1.0))
    assert file.path.read_text().splitlines()[1:] == ["120,1.0,nan", "180,1.0,nan", "240,1.0,nan", "300,2.0,1.0"]


def test_a_folder_that_is_none_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"friction-a\.csv: cannot be kept"):
        FrictionFile(tmp_path / "file", "a", 3)


def test_names_that_differ_in_what_a_file_name_cannot_hold_have_files_of_their_own(tmp_path: Path) -> None:
    names = ("FV 1", "FV_1", "FV/1", "FV.1")
    assert len({FrictionFile(tmp_path, name, 3).path for name in names}) == len(names)

"""The recording format: what is written comes back bit by bit, and faults are named by line."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.errors import InputError
from config.recording import LONGEST_LINE, Recording, read_recording, write_recording
from workbench.imports.file_kind import raw_tables

HEADER = "time_s,command_pa,position_m\n"


def problem(path: Path, text: str) -> str:
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_recording(path)
    return str(caught.value).removeprefix(f"{path}: ")


def test_every_bit_survives(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    columns = {name: random.normal(size=50) for name in ("command_pa", "position_m", "pressure_pa")}
    written = Recording({"time_s": np.cumsum(random.uniform(0.1, 1, 50)), **columns}, {"valve": "v"})
    write_recording(tmp_path / "r.csv", written)
    read = read_recording(tmp_path / "r.csv")
    assert read.metadata == {"valve": "v"}
    for name, column in written.columns.items():
        np.testing.assert_array_equal(read.columns[name], column)


@pytest.mark.parametrize("text", ["", "\n \r\n", "# valve: v\n"])
def test_an_empty_file_is_said_to_be_empty(tmp_path: Path, text: str) -> None:
    (tmp_path / "rec.csv").write_text(text)
    with pytest.raises(InputError, match=r"is empty; its first line should name the columns: time_s, command_pa"):
        read_recording(tmp_path / "rec.csv")


def test_an_empty_cell_is_not_a_number_and_stays(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(HEADER + "0,1,2\n1,,3\n")
    np.testing.assert_array_equal(read_recording(tmp_path / "r.csv").command_pa, [1.0, np.nan])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,command_pa\n0,1\n", "column position_m is missing; line 1 names: time_s, command_pa"),
        (HEADER, "holds no samples"),
        ("MATLAB 5.0\0\0\0\n0,1\n", "is not a CSV file of ours: no text; `positioner import "),
        (HEADER + "0,1,2\n1,1\n2,1,1\n", "line 3: 2 values, the header names 3"),
        (HEADER + "0,1,2\n1,one,2\n", "line 3: 'one' is not a number"),
        ("# valve: v\n" + HEADER + "0,1,2\n0,1,2\n", "time_s must increase strictly: sample 2 (about line 4)"),
        (HEADER + "0,1,2\nnan,1,2\n", "time_s: sample 2 is not a number"),
    ],
)
def test_faults_are_named(tmp_path: Path, text: str, said: str) -> None:
    assert problem(tmp_path / "r.csv", text).startswith(said)


def test_a_line_torn_by_a_crash_is_left_out_and_told(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text(HEADER + "0,1,2\n1,1,2\n2,1")
    read = read_recording(tmp_path / "r.csv")
    assert len(read) == 2
    assert read.metadata["torn"] == "the last line, 4, is not whole and was left out"


@pytest.mark.parametrize("cell", ["3.4e38", "-1e160", "inf"])
def test_what_no_instrument_shows_is_taken_as_missing_and_told(tmp_path: Path, cell: str) -> None:
    path = tmp_path / "r.csv"
    path.write_text(f"time_s,command_pa,position_m,unix_ns\n0,1,2,1.7e18\n1,1,{cell},1.7e18\n2,1,2,1.7e18\n")
    read = Recording.read(path)
    np.testing.assert_array_equal(read.position_m, [2.0, np.nan, 2.0])
    assert (read.columns["unix_ns"] == 1.7e18).all(), "no quantity of a valve's"
    assert read.metadata["not measured"].startswith(f"position_m of sample 2 is {float(cell):g}: beyond 1e+12")


def test_the_span_of_a_time_of_today_is_said_to_the_second() -> None:
    time_s = 1_780_000_000.0 + np.arange(100.0)
    said = Recording({"time_s": time_s, "command_pa": time_s * 0.0, "position_m": time_s * 0.0}).summary()
    assert "1780000000" in said
    assert "1780000099" in said


@pytest.mark.parametrize(("period_s", "said"), [(0.01, "10 ms apart"), (1.0, "1 s apart"), (35.0, "35 s apart")])
def test_how_far_samples_lie_apart_is_said_in_a_unit_of_its_size(period_s: float, said: str) -> None:
    """A historian's that keeps changes alone were 3.5e+04 ms apart."""
    time_s = np.linspace(0.0, 4.0 * period_s, 5)
    assert said in Recording({"time_s": time_s, "command_pa": time_s, "position_m": time_s}).summary()


def test_a_recording_named_gz_is_compressed_and_read_again(tmp_path: Path) -> None:
    recording = Recording({name: np.arange(3.0) for name in ("time_s", "command_pa", "position_m")}, {"valve": "seed"})
    files = [tmp_path / name for name in ("one.csv.gz", "two.csv.gz")]
    for path in files:
        write_recording(path, recording)
    assert files[0].read_bytes() == files[1].read_bytes()
    again = read_recording(files[0])
    assert again.metadata["valve"] == "seed"
    assert all((again.columns[name] == column).all() for name, column in recording.columns.items())


@pytest.mark.parametrize("name", ["r.xlsx", "r.H5", "r.mf4", "r.csv.zst"])
def test_a_name_that_promises_another_format_is_refused(name: str, tmp_path: Path) -> None:
    """It was written as CSV under that name, which no other program opened."""
    with pytest.raises(
        InputError, match=r"a recording is not written as \.\w+; allowed are \.csv, \.csv\.gz, \.parquet"
    ):
        write_recording(
            tmp_path / name, Recording({"time_s": np.arange(3.0), "command_pa": np.ones(3), "position_m": np.zeros(3)})
        )
    assert not (tmp_path / name).exists()


def test_series_lists_and_masked_arrays_become_plain_columns() -> None:
    """A data frame's columns ended in "could not broadcast", and what a mask hides was taken for measured."""
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame({"time_s": [0, 1, 2, 3], "command_pa": [1.0, 2.0, 3.0, 4.0]})[1:]
    masked = np.ma.masked_array([5.0, 6.0, 7.0], mask=[False, True, False])
    given: dict[str, Any] = {"time_s": frame.time_s, "command_pa": list(frame.command_pa), "position_m": masked}
    made = Recording(given)
    assert all(type(each) is np.ndarray and each.dtype.kind == "f" for each in made.columns.values())
    assert made.command_pa[0] == 2.0
    np.testing.assert_array_equal(made.position_m, [5.0, np.nan, 7.0])


@pytest.mark.parametrize(
    ("given", "got"),
    [
        (np.zeros((3, 1)), "an array of shape (3, 1)"),
        (np.array(["1", "2"]), "values of kind <U1"),
        (np.array(["2026-01-01"], dtype="datetime64[s]"), "values of kind datetime64"),
        (np.array([1.0, "Bad"], dtype=object), "values of kind object"),
    ],
)
def test_what_is_no_column_of_numbers_is_refused_by_name(given: Any, got: str) -> None:
    with pytest.raises(InputError) as caught:
        Recording({"time_s": given})
    assert f"time_s: allowed is one number a sample, NaN where none is known, got {got}" in str(caught.value)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"position_m": None}, "column position_m is missing; there are: time_s, command_pa"),
        ({"position_m": [0.0, 1.0]}, "position_m holds 2 values, time_s 5"),
        (
            {name: np.zeros(15) for name in ("time_s", "command_pa", "position_m")},
            "time_s must increase: it does not at 14 of 15 samples; sample 2 is at 0 s after 0 s",
        ),
        (
            {"time_s": np.arange(5.0)[::-1]},
            "time_s must increase: it does not at 4 of 5 samples; sample 2 is at 3 s after 4 s",
        ),
        ({"time_s": [0.0, 1.0, np.nan, 3.0, 4.0]}, "time_s: sample 3 is not a number"),
    ],
)
def test_what_is_no_recording_is_refused_when_it_is_made(changed: dict[str, Any], said: str) -> None:
    """It was found minutes later, by another name, or not at all."""
    whole = {"time_s": np.arange(5.0), "command_pa": np.zeros(5), "position_m": np.zeros(5)}
    with pytest.raises(InputError) as caught:
        Recording({name: each for name, each in (whole | changed).items() if each is not None})
    assert str(caught.value) == f"recording: {said}"


def test_a_recording_behind_a_positioner_of_forces_and_with_a_clock_set_back_once_are_ones() -> None:
    time_s = np.concatenate([np.arange(100.0), np.arange(90.0, 190.0)])
    one = np.zeros(200)
    assert len(Recording({"time_s": time_s, "reference_m": one, "position_m": one})) == 200
    assert Recording({"time_s": time_s, "pressure_pa": one, "position_m": one, "load_n": one}).columns
    assert Recording({"branch": one, "pressure_pa": one, "position_m": one}).columns


def test_a_file_of_zeros_is_refused_by_its_beginning(tmp_path: Path) -> None:
    path = tmp_path / "zeros.csv"
    with path.open("wb") as file:
        file.truncate(2 * LONGEST_LINE)
    with pytest.raises(InputError, match="is not a CSV file of ours: line 1 is longer than"):
        read_recording(path)
    with pytest.raises(InputError, match=r"begins with zeros alone: it is damaged, or no text$"):
        raw_tables(path)


@pytest.mark.parametrize("time_s", ["1e308", "-1e308", "3e12"])
def test_a_time_that_is_none_is_one_line(time_s: str, tmp_path: Path) -> None:
    """It broke least squares down, and their steps were infinite."""
    rows = [f"{0.1 * i},5e4,0.01" for i in range(60)]
    rows[0 if time_s.startswith("-") else -1] = f"{time_s},5e4,0.01"
    (tmp_path / "r.csv").write_text("\n".join(["time_s,command_pa,position_m", *rows]))
    with pytest.raises(InputError, match=r"time_s: sample (1|60) is at .* s; allowed are 1e\+12 s either way"):
        Recording.read(tmp_path / "r.csv")

"""Files and arguments that somebody else gave: one line that names file, key, value and what is allowed; never more."""

import os
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from config import plain_file
from config.daemon_file import load_valves
from config.errors import PROBLEM_CHARACTERS, InputError
from config.plain_file import MOST_BYTES, MOST_COLUMNS, MOST_VALUES
from config.recording import Recording
from config.role_passwords import read_passwords
from fieldbus.canopen.eds import read_eds
from positioner.cli.main import main
from positioner.daemon.health.health_file import HealthRecord, read_record
from workbench.imports.file_kind import raw_tables
from workbench.imports.text_table import text_tables

DIGITS = "9" * 5000
VALVE = "[valve]\nstroke_m = 0.1\n"
DAEMON_FILES = {
    "valve of 5000 digits": (f"[valve]\nstroke_m = {DIGITS}\n", "is not valid TOML: Exceeds the limit"),
    "port of 5000 digits": (f"{VALVE}[device]\nport = {DIGITS}\n", "is not valid TOML: Exceeds the limit"),
    "nested": (f"{VALVE}[device]\nx = {'[' * 100_000}", "is not valid TOML"),
    "NUL in a folder": (VALVE + '[recorder]\nfolder = "a\\u0000b"\n', "recorder.folder: must be the name"),
    "NUL in a file": (VALVE + '[law]\nvalve = "a\\u0000b"\n', "law.valve: must be the name"),
    "no folder": (VALVE + '[memory]\nfolder = ""\n', "memory.folder: must be the name"),
    "no host": (VALVE + '[supervisory]\nhost = ""\n', "supervisory.host: must be a host name or an IP address, got ''"),
    "a host of two lines": (VALVE + '[supervisory]\nhost = "a\\nb"\n', "supervisory.host: must be a host name"),
    "a table that is a number": (f"supervisory = 1\n{VALVE}", "supervisory: must be a table"),
    "the same for several": (
        "supervisory = 1\n[[valve]]\nname = 'a'\nunit = 1\nstroke_m = 0.1\n",
        "supervisory: must be a table, got 1",
    ),
    "several are one number": ("valve = [1]\n", "valve 1: is not a table"),
}


@pytest.mark.parametrize("case", DAEMON_FILES)
def test_a_daemons_file_that_is_none_is_one_line(case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, said = DAEMON_FILES[case]
    path = tmp_path / "daemon.toml"
    path.write_text(text)
    for words in (["run", str(path)], ["probe", str(path)], ["get", "--config", str(path), "mode"]):
        assert main(words) == 2
        printed = capsys.readouterr().err
        assert printed.startswith(f"positioner {words[0]}: {path}: ")
        assert said in printed
        assert printed.count("\n") == 1
        assert len(printed) < 500 + len(str(path))


def fifo(path: Path) -> None:
    os.mkfifo(path)


def large(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(MOST_BYTES + 1)


@pytest.mark.parametrize(
    ("make", "said"),
    [(fifo, "is not a regular file"), (large, "bytes, allowed are"), (Path.mkdir, "Is a directory")],
)
def test_what_waits_for_ever_or_has_no_end_is_not_opened(
    make: Callable[[Path], None], said: str, tmp_path: Path
) -> None:
    path = tmp_path / "file"
    make(path)
    for read in (load_valves, lambda each: read_eds(each, 1)):
        with pytest.raises(InputError, match=said):
            read(path)


@pytest.mark.parametrize(
    "words",
    [["--port", "99999"], ["--port", "0"], ["--port", DIGITS], ["--unit", "999"], ["--unit", "-1"], ["--unit", "1e2"]],
    ids=lambda words: f"{words[0]} {words[1][:5]}",
)
def test_an_address_that_is_none_is_refused_before_anybody_is_called(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["get", *words, "mode"])
    assert ended.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1].startswith(f"positioner get: argument {words[0]}: ")


HEADER = "time_s,command_pa,position_m"


def test_a_field_of_a_million_characters_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    for field in ("1" * 1_000_000, '"' + "x" * 1_000_000 + '"'):
        path.write_text(f"{HEADER}\n0,1,0.01\n1,1,{field}\n")
        with pytest.raises(InputError, match="field larger than field limit"):
            Recording.read(path)


def test_a_number_behind_a_sign_that_nobody_sees_is_one_line(tmp_path: Path) -> None:
    """Found by fuzzing: a unit separator is a blank for `str.strip`, and none for `float`."""
    path = tmp_path / "rec.csv"
    path.write_text(f"{HEADER}\n0,1,0.01\n1,1,\x1f0.1\n")
    with pytest.raises(InputError, match=r"line 3: .* is not a number"):
        Recording.read(path)


def test_a_hundred_thousand_columns_are_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "rec.csv"
    names = ",".join(f"c{n}" for n in range(100_000))
    path.write_text(f"{HEADER},{names}\n0,1,0.01{',0' * 100_000}\n")
    with pytest.raises(InputError, match=f"100003 columns; allowed are {MOST_COLUMNS}"):
        Recording.read(path)
    (commas,) = text_tables(path)
    with pytest.raises(InputError, match=f"line 1: 100003 fields; allowed are {MOST_COLUMNS}"):
        next(commas.rows())


def test_a_parquet_file_that_declares_more_than_fits_is_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    assert MOST_VALUES * 8 <= 2**31, "bytes"
    monkeypatch.setattr(plain_file, "MOST_VALUES", 999_999)
    monkeypatch.setattr(parquet, "read_table", None)
    path = tmp_path / "rec.parquet"
    parquet.write_table(arrow.table({"time_s": [0.0] * 1_000_000}), path, compression="zstd")
    assert path.stat().st_size < 5e3
    for read in (Recording.read, raw_tables):
        with pytest.raises(InputError, match=r"declares 1000000 rows of 1 columns; allowed are"):
            read(path)


@pytest.mark.parametrize("out", ["nowhere/rec.csv", "nowhere/rec.parquet", "."])
def test_an_output_to_nowhere_is_one_line(out: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "in.csv").write_text("time_s,command_pa\n0,4e4\n0.001,4e4\n")
    path = tmp_path / out
    assert main(["simulate", "seed", "--input", str(tmp_path / "in.csv"), "-o", str(path)]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith(f"positioner simulate: -o {path}: cannot be written: ")
    assert printed.count("\n") == 1
    with pytest.raises(InputError, match="cannot be written: "):
        Recording({name: np.zeros(1) for name in ("time_s", "command_pa", "position_m")}).write(path)


def test_an_output_that_is_the_input_is_refused_and_left_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    text = "time_s,command_pa,position_m\n0,4e4,0\n0.001,4e4,0\n"
    Path("in.csv").write_text(text)
    Path("alias.csv").symlink_to("in.csv")
    for words, said in (
        (["simulate", "seed", "--input", "in.csv", "-o", "./in.csv"], "-o in.csv: is read by this command as well"),
        (["import", "in.csv", "-o", "alias.csv"], "-o alias.csv: is read by this command as well"),
        (
            ["diagnose", "in.csv", "--valve", "seed", "--json", "in.csv"],
            "--json in.csv: is read by this command as well",
        ),
        (["compare", "in.csv", "--valve", "seed", "--json", "x", "--report", "x"], "--report x: is written by --json"),
    ):
        assert main(words) == 2
        assert capsys.readouterr().err.startswith(f"positioner {words[0]}: {said}")
    assert Path("in.csv").read_text() == text


@pytest.mark.parametrize(
    ("words", "module", "said"),
    [
        (["compare", "in.csv", "--valve", "seed", "--report", "a.html"], "plotly", "--report a.html: it needs plotly"),
        (["diagnose", "in.csv", "--valve", "seed", "--report", "a.html"], "plotly", "--report a.html: it needs plotly"),
        (
            ["discover", "in.csv", "--valve", "seed", "--picture", "a.png"],
            "matplotlib.pyplot",
            "--picture a.png: it needs matplotlib",
        ),
    ],
)
def test_what_draws_an_output_is_asked_for_before_the_input_is_read(
    words: list[str],
    module: str,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    assert main(words) == 2
    assert capsys.readouterr().err.startswith(f"positioner {words[0]}: {said}, which is not installed: pip install")


def test_what_a_library_says_in_lines_or_at_length_is_one_line_of_bounded_length(tmp_path: Path) -> None:
    """Found by fuzzing: a data sheet, a cell and a Parquet file whose reader's complaint went through as it was."""
    sheet = tmp_path / "node.eds"
    sheet.write_text("[DeviceInfo]\n" + "x" * 30_000 + "\n")
    table = tmp_path / "rec.csv"
    table.write_text(f"{HEADER}\n0,{'x' * 30_000},0\n")
    broken = tmp_path / "rec.parquet"
    Recording({name: np.linspace(0.0, 1.0, 100) for name in HEADER.split(",")}).write(broken)
    data = bytearray(broken.read_bytes())
    data[4:40] = bytes(36)
    broken.write_bytes(data)
    for path, read in ((sheet, lambda each: read_eds(each, 1)), (table, Recording.read), (broken, Recording.read)):
        with pytest.raises(InputError) as caught:
            read(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert str(caught.value).isprintable()
        assert len(str(caught.value)) < PROBLEM_CHARACTERS + len(str(path)) + 10


def test_a_file_of_passwords_nested_without_end_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "roles.json"
    path.write_text("[" * 100_000)
    with pytest.raises(InputError, match="is no file of passwords"):
        read_passwords(path)


def test_a_health_file_with_a_number_beyond_all_is_put_aside(tmp_path: Path) -> None:
    path = tmp_path / "a.health.json"
    rest = '"reversals": 0, "stiction_index": 0.0, "moves_judged": 0, "baseline_pa": null'
    beyond = (("1" + "0" * 400, "travel_m: "), (DIGITS, "is not JSON: Exceeds the limit"))
    for number, said in beyond:
        path.write_text(f'{{"version": 1, "valve": "a", "travel_m": {number}, {rest}}}')
        kept = read_record(path, "a", {})
        assert kept.record == HealthRecord()
        assert kept.problem is not None
        assert said in kept.problem
        assert (tmp_path / "a.health.json.unreadable").exists()

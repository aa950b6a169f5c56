"""A historian's export: their names and units, separators, decimal commas, time stamps."""

from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Recording
from workbench.imports import sample_rows
from workbench.imports.column_mapping import read_mapping
from workbench.imports.historian_export import read_export

MAPPING = ("time_s=Zeit", "position_m=PV:%", "command_pa=OUT:bar")


def test_a_german_export_with_time_stamps(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text(
        "Zeit;PV;OUT\n2026-01-31T12:00:00;50,5;0,6\n2026-01-31T12:00:00.5;Bad;0,7\n2026-01-31T12:00:02;51;0,8\n"
    )
    recording = read_export(path, read_mapping(MAPPING), stroke_m=0.1)
    np.testing.assert_allclose(recording.time_s, [0.0, 0.5, 2.0])
    np.testing.assert_allclose(recording.position_m, [0.0505, np.nan, 0.051])
    np.testing.assert_allclose(recording.command_pa, [6e4, 7e4, 8e4])
    assert recording.metadata["not numbers in PV"] == "1"


def test_per_cent_of_a_pressure_range_and_seconds(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text("t,PV,OUT\n0,1,0\n1,2,100\n")
    mapping = read_mapping(("time_s=t:ms", "position_m=PV:mm", "command_pa=OUT:%"))
    recording = read_export(path, mapping, 0.1)
    np.testing.assert_allclose(recording.time_s, [0.0, 1e-3])
    np.testing.assert_allclose(recording.position_m, [1e-3, 2e-3])
    np.testing.assert_allclose(recording.command_pa, [2e4, 1e5])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (MAPPING[:2], "command_pa is not given: add --column command_pa=THEIRS:UNIT"),
        ((*MAPPING, "position_m=SP"), "position_m is given 2 times"),
        (
            (*MAPPING[:2], "command_pa=OUT:furlong"),
            "unknown unit 'furlong'; allowed: Pa, hPa, kPa, MPa, mbar, bar, psi",
        ),
        (("position=PV",), "must be OURS=THEIRS:UNIT"),
    ],
)
def test_faults_of_a_mapping_are_named(words: tuple[str, ...], said: str) -> None:
    with pytest.raises(InputError, match=said):
        read_mapping(words)


def test_faults_of_an_export_are_named(tmp_path: Path) -> None:
    path = tmp_path / "export.csv"
    path.write_text("Zeit,PV\n0,1\n")
    with pytest.raises(InputError, match="column 'OUT' is missing; line 1 names: Zeit, PV"):
        read_export(path, read_mapping(MAPPING), 0.1)
    path.write_text("Zeit,PV,OUT\nyesterday,1,2\n")
    with pytest.raises(InputError, match="sample 1: 'yesterday' is neither seconds nor an ISO time stamp"):
        read_export(path, read_mapping(MAPPING), 0.1)


def test_parquet_without_pyarrow_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(InputError, match="Parquet needs pyarrow"):
        Recording.read(tmp_path / "r.parquet")


def test_a_clock_set_back_once_is_read_and_a_disorder_is_not(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    rows = [(0.01 * i if i < 200 else 0.01 * i - 1.0) for i in range(300)]
    path.write_text("time_s,command_pa,position_m\n" + "".join(f"{t!r},1,2\n" for t in rows))
    assert len(Recording.read(path)) == 300
    path.write_text("time_s,command_pa,position_m\n2,1,2\n1,1,2\n")
    with pytest.raises(InputError, match="time_s must increase strictly"):
        Recording.read(path)


def test_a_long_export_is_told_while_it_is_read_and_one_too_long_is_refused_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "export.csv"
    path.write_text("Zeit,PV,OUT\n" + "".join(f"{i},{i % 7}.5,1.5\n" for i in range(200)))
    monkeypatch.setattr(sample_rows, "TOLD_EVERY", 50)
    told: list[tuple[str, float]] = []
    read_export(path, read_mapping(MAPPING), 0.1, progress=lambda what, done: told.append((what, done)))
    assert told[1][0] == "reading export.csv: 100 rows"
    assert told[1][1] == pytest.approx(0.5, abs=0.01)
    assert told[-1][0] == "understanding 200 rows"
    monkeypatch.setattr(sample_rows, "ROW_LIMIT", 150)
    told.clear()
    with pytest.raises(InputError, match=r"million rows, and an export is read up to .* split the file"):
        read_export(path, read_mapping(MAPPING), 0.1, progress=lambda what, done: told.append((what, done)))
    assert not told

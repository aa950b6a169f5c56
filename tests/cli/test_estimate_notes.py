"""What `positioner estimate` leaves out of a recording is told."""

from pathlib import Path

import pytest

from positioner.cli.main import main


def test_an_absurd_cell_is_told_and_left_out(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "rec.csv"
    rows = [f"{0.01 * i},{100 * i},{1e308 if i == 50 else 1e-4 * i}" for i in range(200)]
    path.write_text("\n".join(["time_s,command_pa,position_m", *rows]) + "\n")
    assert main(["estimate", str(path)]) in (0, 1)
    printed = capsys.readouterr().out
    assert "recording: not measured: position_m of sample 51 is 1e+308: beyond 1e+12 either way" in printed
    assert "recording: position or pressure is missing in sample 51: left out" in printed

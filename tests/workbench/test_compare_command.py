"""`positioner compare` as a person meets it."""

import json
from pathlib import Path

import numpy as np
import pytest

from config.recording import Recording, write_recording
from positioner.cli.main import main
from tests.workbench.valves import SEED, record_of, with_effect

Capture = pytest.CaptureFixture[str]


def written(path: Path, recording: Recording) -> str:
    write_recording(path, recording)
    return str(path)


def test_adequate_is_0_and_not_adequate_is_1(tmp_path: Path, capsys: Capture) -> None:
    true = written(tmp_path / "true.csv", record_of(SEED, 3))
    assert main(["compare", true, "--valve", "seed", "--json", str(tmp_path / "true.json")]) == 0
    assert "the model holds" in capsys.readouterr().out
    assert json.loads((tmp_path / "true.json").read_text())["adequate"] is True
    slack = written(tmp_path / "slack.csv", record_of(with_effect(SEED, "backlash", width_m=2e-3), 5))
    assert main(["compare", slack, "--valve", "seed"]) == 1
    assert "after a reversal" in capsys.readouterr().out


def test_other_units_are_one_line_and_an_export_with_a_mapping_is_read(tmp_path: Path, capsys: Capture) -> None:
    columns = dict(record_of(SEED, 3).columns)
    stroke = SEED.valve.stroke_m
    foreign = columns | {"position_m": columns["position_m"] / stroke * 100, "command_pa": columns["command_pa"] / 1e5}
    path = written(tmp_path / "foreign.csv", Recording(foreign))
    assert main(["compare", path, "--valve", "seed"]) == 2
    err = capsys.readouterr().err
    assert "per cent" in err
    assert err.count("\n") == 1
    mapping = ["time_s=time_s", "position_m=position_m:%", "command_pa=command_pa:bar"]
    words = [word for each in mapping for word in ("--column", each)]
    assert main(["compare", path, "--valve", "seed", *words]) == 0


def test_a_recording_without_motion_is_not_adequate(tmp_path: Path, capsys: Capture) -> None:
    still = {"time_s": np.arange(300.0), "command_pa": np.full(300, 4e4), "position_m": np.full(300, 0.05)}
    assert main(["compare", written(tmp_path / "still.csv", Recording(still)), "--valve", "seed"]) == 1
    assert "does not move" in capsys.readouterr().out

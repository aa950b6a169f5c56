"""`positioner estimate`: the contract, and bad input in one line."""

import json
from pathlib import Path

import numpy as np
import pytest

from positioner.cli.main import main
from tests.estimation.stem import TRUTH, Run, grid, run, swing


def written(folder: Path, each: Run, *, measured: bool = True) -> Path:
    path = folder / "rec.csv"
    command = np.append(each.pressure_pa[1:], each.pressure_pa[-1])  # in force from a row to the next
    names, columns = ["time_s", "command_pa", "position_m"], [each.time_s, command, each.position_m]
    if measured:
        names, columns = [*names, "pressure_pa"], [*columns, each.pressure_pa]
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def swung() -> Run:
    return run(swing, grid(1e-3, -0.1, 0.8), fine_s=1e-3).noisy(np.random.default_rng(1))


@pytest.mark.parametrize("measured", [True, False])
def test_each_name_has_value_std_valid_and_reason(tmp_path: Path, swung: Run, measured: bool) -> None:
    out = tmp_path / "estimated.json"
    assert main(["estimate", str(written(tmp_path, swung, measured=measured)), "--json", str(out)]) == 0
    said = json.loads(out.read_text())
    for name, true in TRUTH.items():
        assert set(said[name]) == {"value", "std", "valid", "reason"}
        assert said[name]["valid"] is True
        assert said[name]["reason"] == ""
        assert abs(said[name]["value"] - true) < 5 * said[name]["std"]
        assert said[name]["std"] < 0.01 * abs(true)
    assert said["pressure"] == "held"


def test_what_does_not_move_is_refused_with_its_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    still = run(lambda _: 1e4, grid(1e-3, -0.1, 0.4), fine_s=1e-3).noisy(np.random.default_rng(1))
    out = tmp_path / "estimated.json"
    assert main(["estimate", str(written(tmp_path, still)), "--json", str(out)]) == 1
    said = json.loads(out.read_text())
    assert said["b_over_c"] == {
        "value": None,
        "std": None,
        "valid": False,
        "reason": "the stem has not been seen to move yet",
    }
    out_said = capsys.readouterr().out
    assert out_said.count("the stem has not been seen to move yet") == 1, "said once, of all that it is the reason of"


def test_bad_input_is_one_line(tmp_path: Path, swung: Run, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path, swung)
    assert main(["estimate", str(path), "--noise-m", "-1"]) == 2
    assert main(["estimate", str(tmp_path / "none.csv")]) == 2
    assert main(["estimate", str(path), "--json", str(tmp_path / "no" / "such.json")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    assert "--noise-m" in lines[0]

"""Extend: the new file, its errors, its journal, and that the simulated valve takes it as it is."""

import json
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import write_recording
from config.valve_file import load_valve
from config.valve_file_writer import valve_toml
from positioner.cli.main import main
from sim.valve import Valve
from tests.workbench.valves import SEED, drawn_valve, record_of, with_effect
from workbench.diagnosis.extension_journal import Journal
from workbench.report import report_journal

BARE = drawn_valve(np.random.default_rng(11))
LAG_S = 0.08
COUNT = 1500


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a valve with a lag, what is known of the valve, and what `extend` made of both."""
    folder = tmp_path_factory.mktemp("extend")
    write_recording(folder / "rec.csv", record_of(with_effect(BARE, "ip_lag", time_constant_s=LAG_S), 5, COUNT))
    (folder / "old.toml").write_text(valve_toml(BARE), encoding="utf-8")
    words = ["extend", str(folder / "old.toml"), "--effect", "ip_lag", "--fit", str(folder / "rec.csv")]
    status = main([*words, "-o", str(folder / "new.toml")])
    (folder / "status").write_text(str(status))
    return folder


def test_the_error_falls_and_the_exit_status_says_so(folder: Path) -> None:
    assert (folder / "status").read_text() == "0"
    step = Journal.beside(folder / "new.toml").steps[0]
    assert step.effects == ("ip_lag",)
    assert step.extended_test_rmse_m < 0.5 * step.refitted_test_rmse_m
    assert step.extended_train_rmse_m < 1.1 * (step.floor_m or 0.0)
    assert "evidence" in step.why


def test_the_new_file_holds_the_effect_and_the_valve_runs_with_it(folder: Path) -> None:
    new = load_valve(folder / "new.toml")
    assert [each.name for each in new.effect] == ["ip_lag"]
    assert new.effect[0].parameters["time_constant_s"] == pytest.approx(LAG_S, rel=0.05)
    valve = Valve.from_file(new)
    valve.advance(5e4, LAG_S)
    assert valve.pressure_pa == pytest.approx(5e4 * (1.0 - np.exp(-1.0)), rel=0.05)


def test_compare_holds_the_new_file_against_the_same_recording(folder: Path) -> None:
    errors = {}
    for name in ("old", "new"):
        out = folder / f"{name}.json"
        main(["compare", str(folder / "rec.csv"), "--valve", str(folder / f"{name}.toml"), "--json", str(out)])
        errors[name] = json.loads(out.read_text())["robust_m"]
    assert errors["new"] < 0.5 * errors["old"]


def test_without_an_effect_the_valve_is_refitted_as_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_recording(tmp_path / "rec.csv", record_of(BARE, 4, COUNT))
    (tmp_path / "seed.toml").write_text(valve_toml(SEED), encoding="utf-8")
    words = [
        "extend",
        str(tmp_path / "seed.toml"),
        "--fit",
        str(tmp_path / "rec.csv"),
        "-o",
        str(tmp_path / "own.toml"),
    ]
    assert main(words) == 0
    assert "refitted, nothing added: the held-out error falls from" in capsys.readouterr().out
    (step,) = Journal.beside(tmp_path / "own.toml").steps
    assert step.effects == ()
    assert step.extended_test_rmse_m < 0.1 * step.given_test_rmse_m
    report_journal(Journal.beside(tmp_path / "own.toml"), tmp_path / "own.html", "own", BARE.valve.own)
    assert "times the floor is left" in step.why, "what is left says whether parameters alone were wrong"
    assert "Step 1: refitted, nothing added" in (tmp_path / "own.html").read_text(encoding="utf-8")


def test_an_effect_that_is_there_already_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    new = str(folder / "new.toml")
    words = ["extend", new, "--effect", "ip_lag", "--fit", str(folder / "rec.csv"), "-o", str(folder / "again.toml")]
    assert main(words) == 2
    assert f"{new}: effect ip_lag is there already" in capsys.readouterr().err
    assert not (folder / "again.toml").exists()


def test_a_file_that_is_no_journal_is_said(tmp_path: Path) -> None:
    (tmp_path / "valve.journal.json").write_text('{"steps": 3}')
    with pytest.raises(InputError, match="is not a journal"):
        Journal.beside(tmp_path / "valve.toml")

"""Whole diagnoses on recordings of 15 s, with small libraries, and the experiment.

What is concluded from fits, every verdict and every refusal, is tested on hand-made ones: `test_effect_candidates`,
`test_effect_search`, `test_verdict`.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.recording import Recording, read_table, write_recording
from config.valve_file import load_valve
from config.valve_file_writer import valve_toml
from positioner.cli.main import main
from tests.workbench.valves import SEED, drawn_valve, record_of, with_effect
from workbench.diagnosis.diagnosis import Diagnosis, diagnose
from workbench.diagnosis.extension import extend, extension_of
from workbench.diagnosis.extension_journal import Journal, write_extended
from workbench.fit.fitting import fit
from workbench.select.separating_experiment import MENU, experiment

BARE = drawn_valve(np.random.default_rng(11))
LAGGING = with_effect(BARE, "ip_lag", time_constant_s=0.05)
COUNT = 1500


@pytest.fixture(scope="module")
def lagging() -> tuple[Recording, Recording]:
    return record_of(LAGGING, 1, COUNT), record_of(LAGGING, 2, COUNT)


@pytest.fixture(scope="module")
def diagnosed(lagging: tuple[Recording, Recording]) -> Diagnosis:
    return diagnose(lagging[0], SEED, test=lagging[1], effects=("sensor_lag", "ip_lag"))


def test_the_missing_effect_is_named_and_explains_all(diagnosed: Diagnosis) -> None:
    assert diagnosed.verdict == "missing", diagnosed.sentence
    assert diagnosed.missing == ("ip_lag",)
    assert diagnosed.indistinguishable == ()
    assert diagnosed.best.errors.train_rmse_m < 1.1 * diagnosed.split.scale_m < diagnosed.base.errors.train_rmse_m
    assert diagnosed.best.fit.parameters["ip_lag.time_constant_s"].value == pytest.approx(0.05, rel=0.02)


def test_the_best_is_listed_first_and_the_preview_ranks_all(diagnosed: Diagnosis) -> None:
    assert diagnosed.candidates[0].name == "ip_lag"
    assert {each.name for each in diagnosed.preview} == {"ip_lag", "sensor_lag"}
    assert diagnosed.preview[0].score >= diagnosed.preview[1].score


def test_what_is_added_by_hand_goes_on_from_the_fits_of_the_diagnosis(
    lagging: tuple[Recording, Recording], diagnosed: Diagnosis
) -> None:
    there = diagnosed.fit_with(("sensor_lag",))
    assert there is not None
    assert diagnosed.fit_with(("sensor_lag", "ip_lag")) is None
    added = extend(lagging[0], SEED, ("sensor_lag",), test=lagging[1], diagnosis=diagnosed)
    assert added.refitted is diagnosed.base.fit
    assert added.extended.cost <= there.cost


@pytest.mark.long
def test_the_experiment_separates_what_it_was_chosen_for(diagnosed: Diagnosis, tmp_path: Path) -> None:
    fits = [each.model.fit for each in diagnosed.candidates if each.step == 1 and each.model]
    record = diagnosed.split.test.record
    chosen = experiment(fits, record)
    assert chosen.separation > 1.5
    assert record.command_pa.min() <= chosen.command_pa.min() < chosen.command_pa.max() <= record.command_pa.max()
    chosen.write(tmp_path / "experiment.csv")
    columns, _ = read_table(tmp_path / "experiment.csv", ("time_s", "command_pa"))
    assert columns["command_pa"] == pytest.approx(chosen.command_pa, rel=1e-4)


def test_a_valve_is_no_experiment_away_from_itself(diagnosed: Diagnosis, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("workbench.select.separating_experiment.MENU", dict(list(MENU.items())[:2]))
    twins = [diagnosed.best.fit, replace(diagnosed.best.fit)]
    assert experiment(twins, diagnosed.split.test.record).separation < 1.3


def test_what_was_found_is_written_as_extend_writes_it(diagnosed: Diagnosis, tmp_path: Path) -> None:
    given, out = tmp_path / "given.toml", tmp_path / "better.toml"
    given.write_text(valve_toml(SEED), encoding="utf-8")
    extension = extension_of(diagnosed)
    assert extension.effects == ("ip_lag",)
    assert extension.falls
    assert extension.given_test_rmse_m >= extension.refitted_errors.test_rmse_m > extension.extended_errors.test_rmse_m
    write_extended(extension, given, out)
    assert load_valve(out) == diagnosed.best.fit.valve
    (step,) = Journal.beside(out).steps
    assert step.effects == ("ip_lag",)


PUSH = '''"""A push that grows with speed."""
from typing import Annotated, NamedTuple
from sim.effect import Parameter

class Parameters(NamedTuple):
    push_ns2_per_m2: Annotated[float, Parameter("push", 0.0, 1e6)]

def force(v: float, q: Parameters) -> float:
    return q.push_ns2_per_m2 * v * min(abs(v), 0.5)
'''


@pytest.mark.long
def test_a_parameter_that_would_have_to_be_negative_is_not_physical(tmp_path: Path) -> None:
    (tmp_path / "push.py").write_text(PUSH)
    pushed = with_effect(BARE, str(tmp_path / "push.py"), push_ns2_per_m2=1000.0)
    found = fit(record_of(pushed, 6, COUNT // 2), SEED, effects=("quadratic_drag",))
    drag = found.parameters["quadratic_drag.drag_ns2_per_m2"]
    assert (drag.at_bound, drag.physical) == (True, False)
    assert drag.value == pytest.approx(0.0, abs=1.0)


def test_nothing_hidden_nothing_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_recording(tmp_path / "rec.csv", record_of(BARE, 4, COUNT))
    (tmp_path / "valve.toml").write_text(valve_toml(SEED), encoding="utf-8")
    said = _diagnosed(tmp_path, "sensor_gain")
    assert said["status"] == 0
    assert said["parameters_off"]
    assert "better.toml: " in capsys.readouterr().out.splitlines()[-1]
    assert load_valve(tmp_path / "better.toml").effect == ()
    assert said["verdict"] == "adequate"
    assert said["missing"] == said["suspected"] == []
    assert said["base"]["parameters"] == said["best"]["parameters"]
    assert not any(each["accepted"] for each in said["candidates"])
    assert all(each["why_not"] for each in said["candidates"])


def test_a_stem_that_hardly_moves_is_said_with_the_files_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    still = record_of(BARE, 4, 300)
    columns = {**still.columns, "position_m": np.full(300, 0.05)}
    write_recording(tmp_path / "rec.csv", Recording(columns))
    assert main(["diagnose", str(tmp_path / "rec.csv"), "--valve", "seed"]) == 2
    assert f"{tmp_path / 'rec.csv'}: the stem moves 0 times" in capsys.readouterr().err


def _diagnosed(folder: Path, *effects: str) -> dict[str, Any]:
    words = ["diagnose", str(folder / "rec.csv"), "--valve", str(folder / "valve.toml"), "--effects", *effects]
    words += [
        "--json",
        str(folder / "said.json"),
        "--experiment",
        str(folder / "experiment.csv"),
        "-o",
        str(folder / "better.toml"),
    ]
    status = main(words)
    said: dict[str, Any] = json.loads((folder / "said.json").read_text())
    return {"status": status} | said

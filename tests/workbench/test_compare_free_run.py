"""Compare: the true valve is adequate; a hidden effect is not, and the sentences say how it fails."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.errors import InputError
from config.json_value import json_value
from config.recording import Recording
from config.valve_file import EffectTable
from sim.composition import Composition
from sim.open_loop import respond
from tests.workbench.valves import NOISE_M, PERIOD_S, drawn_valve, record_of, with_effect
from workbench.compare.comparison import compare
from workbench.data.record import ready
from workbench.model.free_run import FreeRun


@pytest.mark.parametrize("seed", range(4))
def test_the_true_valve_is_adequate(seed: int) -> None:
    valve = drawn_valve(np.random.default_rng(seed))
    compared = compare(record_of(valve, seed), valve)
    assert compared.adequate, compared.sentences
    assert compared.rms_m == pytest.approx(NOISE_M, rel=0.1)
    assert compared.fit_percent > 99.0
    assert not compared.slips.missed_s
    assert not compared.slips.spurious_s


@pytest.mark.parametrize("at_m", [0.0, 0.05, 0.0123])
def test_a_position_that_is_the_same_throughout_has_no_fit(at_m: float) -> None:
    """Its mean is off by a rounding, and no number stands for an error over nothing."""
    valve, recording = drawn_valve(np.random.default_rng(0)), record_of(drawn_valve(np.random.default_rng(0)), 0)
    columns = {**recording.columns, "position_m": np.full(len(recording), at_m)}
    compared = compare(Recording(columns, recording.metadata), valve)
    assert compared.fit_percent == -np.inf
    assert "fit none, " in compared.summary()


def test_backlash_is_said_to_go_too_far_after_every_reversal() -> None:
    valve = drawn_valve(np.random.default_rng(2))
    compared = compare(record_of(with_effect(valve, "backlash", width_m=1.2e-3), 2), valve)
    assert not compared.adequate
    said = next(each for each in compared.sentences if each.startswith("after a reversal"))
    assert said.endswith("mm too far, both directions")
    assert float(said.split()[6]) == pytest.approx(0.6, abs=0.07)


def test_asymmetric_friction_stands_too_high_throughout() -> None:
    valve = drawn_valve(np.random.default_rng(2))
    compared = compare(record_of(with_effect(valve, "asymmetric_friction", asymmetry=0.15), 2), valve)
    assert any("too high throughout" in each for each in compared.sentences)
    closing, opening = compared.over_direction.mean
    assert closing > 1e-3
    assert opening > 1e-3


def test_measured_pressure_tells_the_pressure_side_from_the_stem_side() -> None:
    bare = drawn_valve(np.random.default_rng(1))
    lagging = with_effect(bare, "ip_lag", time_constant_s=0.3)
    recording = record_of(lagging, 1)
    composition = Composition.from_file(lagging)
    start = bare.valve.diaphragm_area_m2 / bare.valve.spring_n_per_m * recording.command_pa[0]
    path = respond(
        composition,
        composition.theta,
        recording.command_pa[:-1],
        0.01,
        position_m=float(start),
        pressure_pa=float(recording.command_pa[0]),
    )
    compared = compare(Recording(dict(recording.columns) | {"pressure_pa": path.pressure_pa}), bare)
    assert compared.pressure_side is not None
    assert compared.pressure_side.pressure_rms_pa > 1e3
    assert compared.pressure_side.stem_rms_m < 0.05 * compared.rms_m


def test_a_load_acts_as_a_force() -> None:
    valve = drawn_valve(np.random.default_rng(4))
    recording = record_of(valve, 4)
    load_n = 200.0 * np.sin(recording.time_s)
    shifted = dict(recording.columns) | {
        "command_pa": recording.command_pa - load_n / valve.valve.diaphragm_area_m2,
        "load_n": load_n,
    }
    assert compare(Recording(shifted), valve).rms_m == pytest.approx(NOISE_M, rel=0.1)


def test_segments_are_simulated_apart() -> None:
    valve = drawn_valve(np.random.default_rng(0))
    columns = {name: column.copy() for name, column in record_of(valve, 0).columns.items()}
    columns["time_s"][1500:] += 30.0
    record = ready(Recording(columns))
    composition = Composition.from_file(valve)
    simulated = FreeRun(composition, record).position_m(composition.theta)
    assert simulated[1500] == pytest.approx(columns["position_m"][1500], abs=5 * NOISE_M)


@pytest.mark.parametrize(
    "effect",
    [
        {},
        {"name": "ip_lag", "time_constant_s": 0.05},
        {"name": "backlash", "width_m": 1e-3},
        {"name": "dead_time", "dead_time_s": 0.0537},
        {"name": "dead_time", "dead_time_s": 0.0037},
        {"name": "rate_limit", "filling_pa_per_s": 213e3, "venting_pa_per_s": 391e3},
    ],
)
def test_a_run_is_as_exact_as_it_says(effect: dict[str, Any]) -> None:
    bare = drawn_valve(np.random.default_rng(0))
    valve = with_effect(bare, **effect) if effect else bare
    record, composition = ready(record_of(valve, 0)), Composition.from_file(valve)
    fine = FreeRun(composition, record).position_m(composition.theta)
    begin_m = float(FreeRun(composition, record).run(composition.theta).stem_m[0])
    command_pa = record.command_pa
    finest = respond(
        *(composition, composition.theta, command_pa[:-1], PERIOD_S),
        position_m=begin_m,
        pressure_pa=float(command_pa[0]),
    ).indicated_m
    assert np.std(fine - finest) < 5e-7


def test_a_stem_that_never_moves_is_no_proof() -> None:
    n = 500
    still = {"time_s": 0.01 * np.arange(n), "command_pa": np.full(n, 4e4), "position_m": np.full(n, 0.05)}
    compared = compare(Recording(still), drawn_valve(np.random.default_rng(0)))
    assert not compared.adequate
    assert compared.sentences[0].startswith("the stem does not move")


def test_everything_can_be_written_as_json() -> None:
    valve = drawn_valve(np.random.default_rng(0))
    written = json.loads(json.dumps(json_value(compare(record_of(valve, 0), valve)), allow_nan=False))
    assert len(written["residual_m"]) == 3000
    assert set(written["slips"]) == {"matched", "missed_s", "invented_s"}
    assert len(written["autocorrelation"]["value"]) == 26
    assert len(written["input_correlation"]["value"]) == 51


@pytest.mark.parametrize("apart_s", [0.01, 1.0], ids=["fast", "without inertia"])
def test_a_model_without_an_answer_is_not_judged_by_the_rest_of_the_record(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, apart_s: float
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text("import math\ndef sensor(y): return y + 0.0 * math.sqrt(0.05 - y)\n")
    valve = drawn_valve(np.random.default_rng(0))
    rising = np.repeat(np.linspace(0.2, 0.9, 15), 20) * valve.valve.spring_n_per_m * 0.1 / valve.valve.diaphragm_area_m2
    composition = Composition.from_file(valve)
    path = respond(composition, composition.theta, rising[:-1], apart_s, step_s=min(apart_s, 0.01))
    noise = NOISE_M * np.random.default_rng(0).standard_normal(rising.size)
    recording = Recording({"time_s": path.time_s, "command_pa": rising, "position_m": path.indicated_m + noise})
    assert path.indicated_m.max() > 0.05
    lacking = valve.model_copy(update={"effect": (EffectTable.model_validate({"name": str(tmp_path / "own.py")}),)})
    with pytest.raises(InputError, match="nobody can say where the stem is"):
        compare(recording, lacking)

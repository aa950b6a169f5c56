"""A valve seen once a second: its noise, what begins in motion, and what nobody can judge."""

import json
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Column, Recording, write_recording
from positioner.cli.main import main
from signals.noise import position_noise_m
from sim.composition import Composition
from sim.open_loop import respond
from tests.workbench.slow_records import once_a_second
from tests.workbench.valves import NOISE_M, SEED, with_effect
from workbench.compare.comparison import compare
from workbench.data.held_out import split
from workbench.data.noise_floor import UNKNOWN, with_noise
from workbench.data.record import ready
from workbench.diagnosis.diagnosis import diagnose

ASYMMETRIC = with_effect(SEED, "asymmetric_friction", asymmetry=0.15)
EVERY, COUNT = 5, 400
Capture = pytest.CaptureFixture[str]


def seen(every: int = EVERY, *, seed: int = 1, from_row: int = 0, noise_m: float = NOISE_M) -> Recording:
    """Steps of the command in open loop, seen at 1 s; `from_row` leaves out how it begins."""
    generator = np.random.default_rng(seed)
    valve = SEED.valve
    middle_pa = 0.5 * valve.spring_n_per_m * valve.stroke_m / valve.diaphragm_area_m2
    levels_pa = middle_pa * generator.uniform(0.05, 1.95, COUNT // every + 1)
    command_pa: Column = np.concatenate([np.full(EVERY, middle_pa), np.repeat(levels_pa, every)])[:COUNT]
    composition = Composition.from_file(ASYMMETRIC)
    response = respond(composition, composition.theta, command_pa[:-1], 1.0, step_s=0.05)
    position_m = response.indicated_m + noise_m * generator.standard_normal(COUNT)
    time_s: Column = np.arange(float(COUNT))
    rows = slice(from_row, None)
    return Recording({"time_s": time_s[rows], "command_pa": command_pa[rows], "position_m": position_m[rows]})


def restless(count: int = 300) -> Recording:
    """A stem that goes elsewhere from sample to sample, 15 to 90 mm."""
    generator = np.random.default_rng(3)
    position_m: Column = generator.uniform(0.015, 0.09, count)
    pressure_pa = SEED.valve.spring_n_per_m / SEED.valve.diaphragm_area_m2 * position_m
    time_s: Column = np.arange(float(count))
    return Recording({"time_s": time_s, "command_pa": np.append(pressure_pa[1:], 4e4), "position_m": position_m})


def test_the_noise_at_one_second_is_the_sensors() -> None:
    assert ready(seen()).noise_m == pytest.approx(NOISE_M, rel=0.1)


def test_the_true_valve_holds_at_one_second_and_one_that_lacks_the_asymmetry_does_not() -> None:
    assert compare(seen(), ASYMMETRIC).adequate
    without = compare(seen(), SEED)
    assert not without.adequate
    assert any("times the floor" in each for each in without.sentences)


@pytest.mark.parametrize("number", [0, 1, 2])
def test_a_record_that_begins_with_a_step_is_judged_from_where_the_stem_rests(number: int) -> None:
    """The first sample is where the stem was; the command in force at it moves it away."""
    jumps = np.flatnonzero(np.abs(np.diff(seen().position_m)) > 20 * NOISE_M)
    recording = seen(from_row=int(jumps[number]))
    compared = compare(recording, ASYMMETRIC)
    assert compared.adequate, compared.sentences
    assert any("about to move: simulated and judged from sample 2 on" in each for each in compared.notes)


@pytest.mark.long
def test_rests_without_noise_have_a_verdict_where_it_is_said_that_nothing_was_held_back(
    tmp_path: Path, capsys: Capture
) -> None:
    path = tmp_path / "exact.csv"
    write_recording(path, seen(noise_m=0.0))
    asked = ["diagnose", str(path), "--valve", "seed", "--effects", "asymmetric_friction"]
    assert main(asked) == 1
    said = capsys.readouterr().out
    assert "unjudged" in said
    assert "recording: position_m hardly ever changes by little" in said
    assert main([*asked, "--noise-m", "1e-6"]) == 1
    assert "missing: asymmetric_friction" in capsys.readouterr().out


def test_where_nothing_rests_the_noise_is_unknown_and_nothing_is_judged(capsys: Capture, tmp_path: Path) -> None:
    recording = restless()
    record = ready(recording)
    assert record.noise_m is None
    assert record.floor_m is None
    assert split([recording]).floor_m is None
    compared = compare(recording, SEED)
    assert not compared.adequate
    assert compared.floor_m is None
    assert len(compared.slips.matched) + len(compared.slips.missed_s) > 20, "that it moves is seen all the same"
    path = tmp_path / "restless.csv"
    write_recording(path, recording)
    assert main(["compare", str(path), "--valve", "seed"]) == 1
    said = capsys.readouterr().out
    assert "not judged" in said
    assert UNKNOWN in said
    assert main(["compare", str(path), "--valve", "seed", "--noise-m", "5e-5"]) == 1
    said = capsys.readouterr().out
    assert "not adequate" in said
    assert UNKNOWN not in said


def test_a_command_that_repeats_tells_the_noise_of_a_stem_that_never_rests() -> None:
    lap = restless(200).columns
    generator = np.random.default_rng(5)
    columns = {name: np.tile(column, 3) for name, column in lap.items()}
    columns["time_s"] = np.arange(600.0)
    columns["position_m"] = columns["position_m"] + NOISE_M * generator.standard_normal(600)
    record = ready(Recording(columns))
    assert position_noise_m(record.position_m, record.command_pa) is None
    assert record.noise_m == pytest.approx(NOISE_M, rel=0.2)
    assert record.repeatability_m == pytest.approx(NOISE_M, rel=0.2)


def test_a_recording_may_say_its_noise_and_no_other_than_a_positive_one() -> None:
    assert ready(with_noise(seen(), 2e-4)).noise_m == 2e-4
    with pytest.raises(InputError, match="noise_m: must be positive, it is -1"):
        with_noise(seen(), -1.0)
    with pytest.raises(InputError, match="noise_m: loud; it must be a positive number, m"):
        ready(Recording(seen().columns, {"noise_m": "loud"}))


def test_a_stretch_is_taken_by_its_times(tmp_path: Path, capsys: Capture) -> None:
    path = str(tmp_path / "seen.csv")
    write_recording(Path(path), seen())
    asked = ["compare", path, "--valve", "seed", "--from-s", "100", "--to-s", "299", "--json", str(tmp_path / "c.json")]
    assert main(asked) == 1
    time_s = json.loads((tmp_path / "c.json").read_text())["time_s"]
    assert (time_s[0], time_s[-1], len(time_s)) == (100.0, 299.0, 200)
    assert main(["compare", path, "--valve", "seed", "--from-s", "1e4"]) == 2
    assert "no sample lies between 10000 and inf s; time_s goes from 0 to 399" in capsys.readouterr().err


def test_changes_between_samples_without_a_rest_are_refused_in_a_line(tmp_path: Path, capsys: Capture) -> None:
    file = tmp_path / "restless.csv"
    recording = restless()
    columns = dict(recording.columns)
    # a historian keeps when something changed: seldom three readings of one rest
    columns["command_pa"] = SEED.valve.spring_n_per_m / SEED.valve.diaphragm_area_m2 * columns["position_m"]
    columns["position_m"] = np.repeat(columns["position_m"][::2], 2)
    columns["command_pa"] = np.repeat(columns["command_pa"][::2], 2)
    write_recording(file, Recording(columns))
    for command in ("compare", "diagnose"):
        assert main([command, str(file), "--valve", "seed", "--noise-m", "5e-5"]) == 2
        said = capsys.readouterr().err.splitlines()
        assert len(said) == 1
        assert "no slide is seen to end in a rest of three samples, by which alone it could be judged" in said[0]


@pytest.mark.long
def test_a_dead_time_between_two_samples_is_found_alone_and_no_other_effect_beside_it() -> None:
    """Seen once a second its error is a stair, on any step of which a search ends."""
    recording = once_a_second(SEED, 400, held_s=12.0, offset_s=0.5)
    late = {name: column[3:] if name != "position_m" else column[:-3] for name, column in recording.columns.items()}
    found = diagnose([Recording(late, recording.metadata)], SEED, effects=("dead_time", "flow_force"))
    assert found.verdict == "missing"
    assert found.missing == ("dead_time",)
    assert 2.0 < found.best.fit.parameters["dead_time.dead_time_s"].value < 3.0

"""Hidden recordings: drawn the same again, sealed, rich in stick-slip, and telling nobody what is in them."""

import base64
import hashlib
import json
import shutil
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.errors import InputError
from config.recording import read_recording
from config.valve_file import ValveFile, find_valve, load_valve
from positioner.cli.main import main
from signals.moves import slips
from sim.composition import Composition
from sim.effect import first_effects, shipped_effect, shipped_effects, tried_effects
from tests.workbench.valves import error_of
from workbench.blind import trial
from workbench.blind.hiding import Hidden, draw_effects, draw_valve, guess_valve, hide, strength
from workbench.blind.input_signal import FIRST_PASSAGE_SHARE, excitation
from workbench.blind.sealing import FILES, SEALED, seal
from workbench.blind.trial import NOISE_M
from workbench.data.noise_floor import repeat_lag, repeatability_m

Capture = pytest.CaptureFixture[str]
SEED = load_valve(find_valve("seed")).valve
SEEDS = range(40)


@pytest.fixture(scope="module")
def hidden() -> Hidden:
    return hide(5)


@pytest.fixture(scope="module")
def bare() -> Hidden:
    return hide(5, effects=0)


@pytest.fixture(scope="module")
def folder(hidden: Hidden, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("blind")
    seal(folder, hidden)
    return folder


def one_line(capture: Capture) -> str:
    out, err = capture.readouterr()
    assert not out
    assert err.count("\n") == 1, err
    return err.strip()


def test_the_same_seed_writes_the_same_files(folder: Path, tmp_path: Path, capsys: Capture) -> None:
    assert main(["hide", "--seed", "5", "-o", str(tmp_path / "again")]) == 0
    for name in (*FILES, SEALED):
        assert (tmp_path / "again" / name).read_bytes() == (folder / name).read_bytes(), name
    seal_printed = json.loads((folder / SEALED).read_text())["sha256"]
    assert capsys.readouterr().out.startswith(f"sealed: SHA-256 {seal_printed}\n")


def test_the_answer_is_nowhere_to_be_read(folder: Path, hidden: Hidden, tmp_path: Path, capsys: Capture) -> None:
    main(["hide", "--seed", "5", "-o", str(tmp_path / "b")])
    printed = "".join(capsys.readouterr())
    open_text = printed + "".join(path.name + path.read_text() for path in sorted(folder.iterdir()))
    (effect,) = hidden.truth.effect
    # What a valve file says of every valve is no secret.
    secrets = [each for each in tried_effects() if each != "stribeck"]
    secrets += [*effect.parameters, *(repr(each) for each in effect.parameters.values())]
    secrets += [repr(getattr(hidden.truth.valve, key)) for key in ("spring_n_per_m", "coulomb_n", "static_n")]
    assert sorted(path.name for path in folder.iterdir()) == sorted((*FILES, SEALED))
    assert not [each for each in secrets if each in open_text]


def test_reveal_prints_what_was_hidden(folder: Path, hidden: Hidden, capsys: Capture) -> None:
    assert main(["hide", "--reveal", str(folder)]) == 0
    out = capsys.readouterr().out
    (effect,) = hidden.truth.effect
    sealed = json.loads((folder / SEALED).read_text())
    answer = base64.b64decode(sealed["answer_base64"])
    assert hashlib.sha256(answer).hexdigest() == sealed["sha256"]
    assert len(json.loads(answer)["salt"]) == 32
    assert f"the seal holds: SHA-256 {sealed['sha256']}" in out
    assert f"hidden: {effect.name}, " in out
    assert all(f"{key} = {value:.4g}" in out for key, value in effect.parameters.items())


def test_a_changed_answer_breaks_the_seal(folder: Path, tmp_path: Path, capsys: Capture) -> None:
    sealed = json.loads((folder / SEALED).read_text())
    answer = json.loads(base64.b64decode(sealed["answer_base64"]))
    answer["effects"][0]["name"] = "backlash"
    sealed["answer_base64"] = base64.b64encode(json.dumps(answer).encode()).decode()
    (tmp_path / SEALED).write_text(json.dumps(sealed))
    assert main(["hide", "--reveal", str(tmp_path)]) == 1
    assert "the answer is not the one that was sealed" in one_line(capsys)


@pytest.mark.parametrize("name", FILES)
def test_a_changed_file_breaks_the_seal(name: str, folder: Path, tmp_path: Path, capsys: Capture) -> None:
    for path in folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    (tmp_path / name).write_bytes((tmp_path / name).read_bytes() + b"\n")
    assert main(["hide", "--reveal", str(tmp_path)]) == 1
    assert f"{name}: is not the file that was sealed" in one_line(capsys)


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["-o", "b"], "--seed: is needed: a whole number, 0 or more"),
        (["--seed", "-1", "-o", "b"], "--seed: must be a whole number, 0 or more, got -1"),
        (["--seed", "1"], "-o: must name the folder"),
        (["--seed", "1", "-o", "b", "--period-s", "2"], "--period-s: must lie between"),
        (["--seed", "1", "-o", "b", "--duration-s", "9"], "--duration-s: must lie between 10 and 3600 s, got 9"),
        (["--reveal", "nowhere"], "cannot be read"),
    ],
)
def test_bad_input_is_one_line(words: list[str], complaint: str, capsys: Capture) -> None:
    assert main(["hide", *words]) == 2
    assert complaint in one_line(capsys)


def test_a_sealed_folder_is_not_written_over(folder: Path, capsys: Capture) -> None:
    before = (folder / SEALED).read_bytes()
    assert main(["hide", "--seed", "6", "-o", str(folder)]) == 2
    assert "holds a sealed answer already" in one_line(capsys)
    assert (folder / SEALED).read_bytes() == before


def test_what_is_no_sealed_answer_is_said(tmp_path: Path, capsys: Capture) -> None:
    for text in ("{", "[]", '{"sha256": "0"}', '{"sha256": "0", "answer_base64": "%"}'):
        (tmp_path / SEALED).write_text(text)
        assert main(["hide", "--reveal", str(tmp_path)]) == 2
        assert "is not a sealed answer" in one_line(capsys)


CRAFTED: dict[str, Callable[[dict[str, Any]], object]] = {
    "no effects": lambda answer: answer.pop("effects"),
    "effects that are words": lambda answer: answer.update(effects=["backlash"]),
    "an effect without a name": lambda answer: answer["effects"][0].pop("name"),
    "an effect of which nothing is said": lambda answer: answer.update(visible={}),
    "a word for a strength": lambda answer: answer["effects"][0].update(gap_m="much"),
    "a list for a valve": lambda answer: answer.update(valve=[]),
    "an empty valve": lambda answer: answer.update(valve={}),
    "no floor": lambda answer: answer.update(floor_m=None),
    "another file": lambda answer: answer["files"].update({"../secret": "0"}),
    "no files": lambda answer: answer.update(files={}),
    "an infinite floor": lambda answer: answer["floor_m"].update(fit=float("inf")),
}


@pytest.mark.parametrize("kind", CRAFTED)
def test_a_crafted_answer_is_one_line(kind: str, folder: Path, tmp_path: Path, capsys: Capture) -> None:
    """Anybody can seal anything: the digest of a crafted answer is right."""
    answer = json.loads(base64.b64decode(json.loads((folder / SEALED).read_text())["answer_base64"]))
    CRAFTED[kind](answer)
    write_sealed(tmp_path, json.dumps(answer).encode())
    assert main(["hide", "--reveal", str(tmp_path)]) == 2
    assert "holds no answer that hide has sealed" in one_line(capsys)


def test_an_answer_whose_names_come_last_is_revealed(folder: Path, tmp_path: Path, capsys: Capture) -> None:
    """A table begins with its name where hide has written it; anybody else may have sorted it."""
    answer = json.loads(base64.b64decode(json.loads((folder / SEALED).read_text())["answer_base64"]))
    for table in (*answer["effects"], answer["valve"]):
        table["name"] = table.pop("name")
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    write_sealed(tmp_path, json.dumps(answer).encode())
    assert main(["hide", "--reveal", str(tmp_path)]) == 0
    assert f"valve: {answer['valve']['name']}, mass_kg = " in capsys.readouterr().out


@pytest.mark.parametrize("text", [b"", b"[]", b"7", b"null", b"\xff", b"[" * 100_000, b'{"files": 1}'])
def test_what_is_no_answer_at_all_is_one_line(text: bytes, tmp_path: Path, capsys: Capture) -> None:
    write_sealed(tmp_path, text)
    assert main(["hide", "--reveal", str(tmp_path)]) == 2
    assert "holds no answer that hide has sealed" in one_line(capsys)


def write_sealed(folder: Path, text: bytes) -> None:
    sealed = {"sha256": hashlib.sha256(text).hexdigest(), "answer_base64": base64.b64encode(text).decode()}
    (folder / SEALED).write_text(json.dumps(sealed))


def test_the_recordings_keep_the_contract(folder: Path, hidden: Hidden) -> None:
    for name, made in (("fit.csv", hidden.fit), ("test.csv", hidden.test)):
        recording = read_recording(folder / name)
        assert tuple(recording.columns) == ("time_s", "command_pa", "position_m")
        assert recording.metadata == {"source": "positioner hide"}
        np.testing.assert_allclose(np.diff(recording.time_s), 0.01, rtol=1e-9)
        assert recording.time_s[-1] == pytest.approx(30.0)
        assert recording.command_pa.min() >= 0.0
        np.testing.assert_array_equal(recording.position_m, made.position_m)
    assert not np.array_equal(hidden.fit.command_pa, hidden.test.command_pa)


def test_the_valve_file_is_what_is_known_not_the_truth(folder: Path, hidden: Hidden) -> None:
    known, true = load_valve(folder / "valve.toml"), hidden.truth.valve
    assert known == hidden.base
    assert not known.effect
    for key, most in (("spring_n_per_m", 1.1), ("viscous_ns_per_m", 2.0), ("coulomb_n", 1.34)):
        ratio = getattr(known.valve, key) / getattr(true, key)
        assert 1.0 / most / 1.01 < ratio < most
        assert abs(ratio - 1.0) > 1e-4
    for key in ("mass_kg", "diaphragm_area_m2", "stribeck_velocity_m_per_s", "deadzone_ratio", "stroke_m"):
        assert getattr(known.valve, key) == getattr(true, key)


def test_valve_and_commands_tell_nothing_of_the_effects(hidden: Hidden, bare: Hidden) -> None:
    assert bare.base == hidden.base
    assert bare.truth.valve == hidden.truth.valve
    np.testing.assert_array_equal(bare.fit.command_pa, hidden.fit.command_pa)
    assert not bare.answer["effects"]
    assert not bare.answer["visible"]


def test_the_floor_is_the_noise_when_clean_and_repeats(bare: Hidden) -> None:
    for name, recording in (("fit", bare.fit), ("test", bare.test)):
        assert bare.answer["floor_m"][name] == pytest.approx(NOISE_M, rel=0.05)
        lag = repeat_lag(recording.command_pa)
        assert lag == len(recording) - round(FIRST_PASSAGE_SHARE * len(recording))
        repeatability = repeatability_m(recording.command_pa, recording.position_m)
        assert repeatability == pytest.approx(NOISE_M, rel=0.15)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_stem_sticks_and_slips_in_both_directions(seed: int) -> None:
    found = hide(seed, effects=0).fit.position_m
    ways = Counter(each.direction for each in slips(found, NOISE_M))
    assert ways[1] >= 10
    assert ways[-1] >= 10
    assert np.ptp(found) > 0.5 * SEED.stroke_m


def test_strengths_that_leave_no_motion_are_drawn_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first draw of this seed is a supply below break-away."""
    truth = hide(21066).truth
    (limit,) = truth.effect
    assert limit.name == "supply_limit"
    assert limit.parameters["supply_pa"] * truth.valve.diaphragm_area_m2 > truth.valve.static_n
    monkeypatch.setattr("workbench.blind.hiding.LEAST_TRAVEL", -1.0)
    first = hide(21066)
    assert first.truth.effect != truth.effect
    assert np.ptp(first.fit.columns["position_m"]) < 0.01 * truth.valve.stroke_m


def test_dirt_raises_the_floor_and_rounds(bare: Hidden) -> None:
    dirty = hide(5, effects=0, dirty=True)
    quantum_m = dirty.truth.valve.stroke_m / 4096
    counts = dirty.fit.position_m / quantum_m
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    np.testing.assert_array_equal(dirty.fit.command_pa, bare.fit.command_pa)
    assert dirty.answer["floor_m"]["fit"] > 2.0 * NOISE_M
    repeatability = repeatability_m(dirty.fit.command_pa, dirty.fit.position_m)
    assert repeatability is not None
    assert repeatability > 2.0 * NOISE_M


@pytest.mark.parametrize(("pressure_pa", "jitter"), [(0.0, 0.0), (300.0, 0.0), (0.0, 0.04)])
def test_each_kind_of_dirt_moves_the_stem(pressure_pa: float, jitter: float, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "PRESSURE_NOISE_PA", pressure_pa)
    monkeypatch.setattr(trial, "BREAK_AWAY_JITTER", jitter)
    composition = Composition.from_file(ValveFile(valve=SEED))
    made = trial.Trial(excitation(SEED, np.random.default_rng(1), 1001), 0.01)
    disturbed = made.with_disturbances(composition, np.random.default_rng(0))
    moved_m = float(np.sqrt(np.mean((disturbed.indicated_m - made.answer_m(composition, composition.theta)) ** 2)))
    assert moved_m > NOISE_M if pressure_pa or jitter else moved_m < 1e-6


def test_an_effect_is_visible_by_what_the_refitted_rest_misses(hidden: Hidden) -> None:
    """Spring and sensor gain are one: what looks large at first is nothing after a refit; a lag stays."""
    (seen,) = hidden.answer["visible"].values()
    assert seen["is_visible"] == (seen["fit_m"] > 0.5 * hidden.answer["floor_m"]["fit"])
    told = {}
    for name in ("sensor_gain", "ip_lag"):
        seed = next(each for each in range(500) if first_effect(each) == name)
        answer = hide(seed).answer
        told[name] = answer["visible"][name]["fit_m"]
    assert told["sensor_gain"] < 0.5 * NOISE_M
    assert told["ip_lag"] > 2.0 * NOISE_M


def first_effect(seed: int) -> str:
    stream = np.random.SeedSequence(seed).spawn(2)[1]
    return draw_effects(np.random.default_rng(stream), 1)[0].name


def test_two_effects_differ_and_can_be_told_apart() -> None:
    generator = np.random.default_rng(0)
    drawn = [draw_effects(generator, 2) for _ in range(300)]
    assert all(len({one.name, other.name}) == 2 for one, other in drawn)
    pairs = {frozenset((one.name, other.name)) for one, other in drawn}
    assert frozenset(("preload", "sensor_offset")) not in pairs
    assert {name for pair in pairs for name in pair} == set(first_effects())


def test_valves_spread_over_their_ranges() -> None:
    valves = [draw_valve(np.random.default_rng(seed)) for seed in range(200)]
    ranges = {
        "coulomb_n": ([each.coulomb_n for each in valves], 250.0, 1424.0),
        "static over coulomb": ([each.static_n / each.coulomb_n for each in valves], 1.05, 1.35),
        "spring": ([each.spring_n_per_m / SEED.spring_n_per_m for each in valves], 0.8, 1.2),
        "viscous": ([each.viscous_ns_per_m / SEED.viscous_ns_per_m for each in valves], 0.5, 3.0),
    }
    for name, (values, low, high) in ranges.items():
        assert low <= min(values) < low + 0.1 * (high - low), name
        assert high - 0.1 * (high - low) < max(values) <= high, name


@pytest.mark.parametrize("name", shipped_effects())
def test_strengths_spread_within_the_declared_starts(name: str) -> None:
    effect, generator = shipped_effect(name, "test"), np.random.default_rng(1)
    known = guess_valve(SEED, generator)
    tables = [strength(effect, SEED, known, generator).parameters for _ in range(200)]
    for key, parameter in effect.parameters.items():
        starts = parameter.starts_for(known if parameter.given else SEED)
        values = [each[key] for each in tables]
        assert min(starts) <= min(values)
        assert max(values) <= max(starts)
        if parameter.given or len(starts) == 1:
            assert set(values) == {starts[0]}
        else:
            assert len(set(values)) == len(values)
            sides = {np.sign(each - (parameter.off or 0.0)) for each in starts if each != parameter.off}
            assert {np.sign(each - (parameter.off or 0.0)) for each in values} == sides
            if len(sides) == 2:
                weakest = min(abs(each - (parameter.off or 0.0)) for each in starts)
                assert min(abs(each - (parameter.off or 0.0)) for each in values) >= weakest


def test_every_command_stays_in_reach_and_repeats() -> None:
    for seed in SEEDS:
        generator = np.random.default_rng(seed)
        known = guess_valve(draw_valve(generator), generator)
        command_pa = excitation(known, generator, 3001)
        most = (known.spring_n_per_m * known.stroke_m + known.coulomb_n) / known.diaphragm_area_m2
        assert command_pa.size == 3001
        assert command_pa.min() >= 0.0
        assert command_pa.max() <= most
        assert repeat_lag(command_pa) == 3001 - round(FIRST_PASSAGE_SHARE * 3001)


def test_the_truth_simulates_to_the_record(hidden: Hidden) -> None:
    """The truth, from the record's own first position, stays at the noise; without its effect it does not."""
    assert error_of(hidden.truth, hidden.fit) < 1.1 * NOISE_M
    assert error_of(hidden.truth.model_copy(update={"effect": ()}), hidden.fit) > 1.3 * NOISE_M


@pytest.mark.parametrize(("seed", "effect"), [(21000, "rate_limit"), (21065, "ip_lag")])
def test_what_the_pressure_path_remembers_from_before_the_record_is_found_in_its_start(seed: int, effect: str) -> None:
    """Both records begin in motion, with a pressure that is far from the first command."""
    hidden = hide(seed)
    assert [each.name for each in hidden.truth.effect] == [effect]
    assert error_of(hidden.truth, hidden.fit) < 1.1 * NOISE_M


@pytest.mark.parametrize(
    ("asked", "problem"),
    [
        ({"seed": -1}, "seed: must be 0 or more, got -1"),
        ({"seed": 1, "duration_s": -5.0}, "period_s: must be above 0 and at most duration_s, got 0.01 of -5 s"),
        (
            {"seed": 1, "duration_s": float("nan")},
            "period_s: must be above 0 and at most duration_s, got 0.01 of nan s",
        ),
        ({"seed": 1, "period_s": 0.0}, "period_s: must be above 0 and at most duration_s, got 0 of 30 s"),
    ],
)
def test_what_holds_no_sample_is_refused(asked: dict[str, Any], problem: str) -> None:
    with pytest.raises(InputError) as refused:
        hide(**asked)
    assert str(refused.value) == problem

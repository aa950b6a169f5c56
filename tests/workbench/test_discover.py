"""Forms: each is an effect's file and adds what its equation says; one that is hidden is found, written and added."""

import struct
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from config.modbus_map import SIMULATED_MAP
from config.recording import Recording, write_recording
from config.valve_file import ValveFile, load_valve
from config.valve_file_writer import valve_toml
from positioner.cli.main import main
from positioner.cli.parts.children import port_in, running
from sim.composition import Composition
from sim.effect import Effect, read_effect, written_here
from sim.interpreted import interpreted
from sim.simulation import simulate
from tests.independent import independent_client
from tests.workbench.valves import SEED, drawn_valve, record_of, with_effect
from workbench.blind.input_signal import excitation
from workbench.data.held_out import split
from workbench.discover import form_search
from workbench.discover.added_force import landings
from workbench.discover.curve import curve_of, has_curve
from workbench.discover.discovery import discover
from workbench.discover.form_file import form_text, write_forms
from workbench.discover.form_proposal import propose_forms
from workbench.discover.grammar import FORMS, Form
from workbench.fit.fit_problem import problem
from workbench.fit.fitting import base_fit

SPRING = Path(__file__).parents[2] / "benchmarks" / "outside" / "second_spring.py"
BARE = drawn_valve(np.random.default_rng(11))
RATE_N_PER_M, PLACE_M = 2e4, 0.04
GUESSED = {name: 1.2 * getattr(BARE.valve, name) for name in ("coulomb_n", "static_n")}
KNOWN = BARE.model_copy(update={"valve": BARE.valve.model_copy(update=GUESSED)})
FEW = ("force_over_position_kink", "added_over_pressure_power")


def named(name: str) -> Form:
    return next(each for each in FORMS if each.name == name)


def force_n(name: str, x: float, **values: float) -> tuple[float, float]:
    """Return what a form adds to force and to opening Coulomb friction of 100 N at a place, moving at 2 m/s."""
    effect = effect_of(named(name))
    laws = interpreted((effect,))
    known = {each.key: each.starts[0] for each in named(name).quantities} | {"travel_m": 0.1} | values
    theta, state = [0.0] * 8 + [known[key] for key in effect.parameters], np.zeros(7 + effect.memory)
    stem = laws.Stem(3.0, x, 2.0, 5e4)
    level_n, _ = laws.friction(100.0, 120.0, 1.0, stem, theta, state)
    return laws.force(0.0, stem, theta, state), level_n - 100.0


def effect_of(form: Form) -> Effect:
    with TemporaryDirectory() as folder:
        (path,) = write_forms([form], Path(folder))
        return read_effect(Path(path))


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.name)
def test_every_form_is_an_effect_that_vanishes_where_its_strength_is_nothing(form: Form, tmp_path: Path) -> None:
    (path,) = write_forms([form], tmp_path)
    effect = read_effect(Path(path))
    assert effect.name == form.name
    assert "a form, not a cause" in effect.text
    assert effect.equation
    strengths = effect.strengths(SEED.valve)
    assert 1 <= len(strengths) <= 48
    laws = interpreted((effect,))
    theta, state = [0.0] * 8 + list(effect.off(SEED.valve)), np.zeros(7 + effect.memory)
    stem = laws.Stem(1.0, 0.05, 0.3, 4e4)
    assert laws.force(0.0, stem, theta, state) == 0.0
    assert laws.friction(100.0, 120.0, 1.0, stem, theta, state) == (100.0, 120.0)
    if "sensor" in effect.functions:
        assert laws.sensor(0.04, stem.x, 0.01, stem, theta, state) == (0.04, stem.x)


def test_names_are_not_given_twice() -> None:
    assert len({each.name for each in FORMS}) == len(FORMS)


@pytest.mark.parametrize(
    ("name", "x", "values", "force", "friction"),
    [
        ("force_constant", 0.05, {"force_n": 30.0}, -30.0, 0.0),
        ("force_over_position_power", 0.05, {"force_n": 40.0, "exponent": 2.0}, -10.0, 0.0),
        ("force_over_position_kink", 0.05, {"force_n": 40.0, "place": 0.25}, -10.0, 0.0),
        ("force_over_position_bump", 0.05, {"force_n": 40.0, "place": 0.4, "width": 0.1}, -40.0 * np.exp(-1.0), 0.0),
        ("force_over_position_wave", 0.05, {"force_n": 40.0, "place": 0.0, "width": 2.0}, -40.0, 0.0),
        ("force_over_position_and_pressure_power", 0.05, {"force_n": 40.0, "exponent": 1.0}, -10.0, 0.0),
        ("drag_over_speed_power", 0.05, {"force_n": 3.0, "exponent": 2.0}, -12.0, 0.0),
        ("one_way_drag_over_speed_power", 0.05, {"force_n": -3.0, "exponent": 2.0}, 0.0, 0.0),
        ("added_over_pressure_power", 0.05, {"growth_n": 40.0, "exponent": 1.0}, 0.0, 20.0),
        ("scaled_over_position_power", 0.05, {"growth": 0.4, "exponent": 1.0}, 0.0, 20.0),
        ("scaled_over_direction_sign", 0.05, {"growth": 0.4}, 0.0, 40.0),
        ("scaled_over_time_rise", 0.05, {"growth": 0.4, "time_constant_s": 3.0}, 0.0, 40.0 * (1.0 - np.exp(-1.0))),
    ],
)
def test_a_form_adds_what_its_equation_says(
    name: str, x: float, values: dict[str, float], force: float, friction: float
) -> None:
    assert force_n(name, x, **values) == pytest.approx((force, friction))


def test_a_found_form_begins_where_it_was_found(tmp_path: Path) -> None:
    form = named("force_over_position_wave")
    values = {"force_n": -123.456, "place": 0.125, "width": 0.31, "travel_m": 0.1016}
    (tmp_path / "mine.py").write_text(form_text(form, values, ["Found in a test."]), encoding="utf-8")
    effect = read_effect(tmp_path / "mine.py")
    assert effect.strengths(SEED.valve) == [tuple(values.values())]
    assert effect.off(SEED.valve)[0] == 0.0
    assert "Found in a test." in effect.source


def sprung(seed: int) -> Recording:
    """Return a recording of the valve with a second spring on its way."""
    hidden = with_effect(BARE, str(SPRING), rate_n_per_m=RATE_N_PER_M, position_m=PLACE_M)
    command_pa = excitation(KNOWN.valve, np.random.default_rng(seed), 1200)
    return record_of(hidden, seed, command_pa=command_pa)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings of that valve, and what is known of it."""
    folder = tmp_path_factory.mktemp("discover")
    for name, seed in (("rec.csv", 5), ("test.csv", 6)):
        write_recording(folder / name, sprung(seed))
    (folder / "known.toml").write_text(valve_toml(KNOWN), encoding="utf-8")
    return folder


def test_projection_puts_a_hidden_form_first_and_landings_miss_its_force(tmp_path: Path) -> None:
    parts = split([sprung(5)], sprung(6))
    of = problem(parts.train.record, KNOWN.valve)
    base = base_fit(of, KNOWN)
    others = ("force_constant", "scaled_over_position_bump", *FEW)
    with written_here(tmp_path):
        effects = {path: read_effect(Path(path)) for path in write_forms([named(each) for each in others], tmp_path)}
        first, *_ = propose_forms(base, of, effects, workers=1)
    assert Path(first.name).stem == FEW[0]
    assert first.points[0][0] > 0.0, "a spring pushes against opening"
    assert PLACE_M / BARE.valve.stroke_m in [pytest.approx(place, abs=0.1) for _, place in first.points]
    missing = landings(replace(base, valve=BARE), parts)
    assert len(missing) > 10
    expected_n = [-RATE_N_PER_M * max(0.0, each.position_m - PLACE_M) for each in missing]
    off_n = [abs(each.missing_n - n) for each, n in zip(missing, expected_n, strict=True)]
    assert min(expected_n) < -500.0
    assert np.median(off_n) < 20.0, "where the command still moves a landing is no balance: not in all of them"


@pytest.mark.long
def test_a_hidden_spring_is_found_written_added_and_served(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    monkeypatch.setattr(form_search, "FORMS", tuple(map(named, FEW)))
    words = ["discover", "rec.csv", "--valve", "known.toml", "--test", "test.csv"]
    assert main([*words, "-o", "met.py", "--picture", "met.png", "--json", "said.json"]) == 0
    said = capsys.readouterr().out
    assert "a form, not a cause: a force that sets in at a place of the position" in said
    assert "--effect ./met.py --fit rec.csv --test test.csv" in said
    assert (folder / "met.png").stat().st_size > 10_000
    effect = read_effect(folder / "met.py")
    ((_, place, stroke_m),) = effect.strengths(BARE.valve)
    assert place * stroke_m == pytest.approx(0.04, abs=1e-3)
    assert main(["discover", "rec.csv", "--valve", "known.toml", "-o", "met.py"]) == 2
    assert "is there already" in capsys.readouterr().err
    words = ["extend", "known.toml", "--effect", "./met.py", "--fit", "rec.csv", "--test", "test.csv"]
    assert main([*words, "-o", "better.toml"]) == 0
    better = load_valve(folder / "better.toml")
    assert better.effect[0].parameters["force_n"] == pytest.approx(RATE_N_PER_M * BARE.valve.stroke_m, rel=0.05)
    assert Composition.from_file(better).effects[0].equation.startswith("F = -F_1 g")
    assert served_m(folder / "better.toml") == pytest.approx(resting_m(better), abs=1e-5)
    without = better.model_copy(update={"effect": ()})
    assert resting_m(without) > resting_m(better) + 4e-3, "or the slave may have served the valve without it"


PUSHED_PA, PUSHED_S = 60e3, 2.0


def served_m(valve: Path) -> float:
    """Return where a slave that serves the valve comes to rest under a pressure, as an independent client reads it."""
    slave = valve.with_name("slave.toml")
    sensor = "[sensor]\nnoise_std_m = 0.0\n"
    slave.write_text(f'valve = "{valve.name}"\n{sensor}[clock]\nmode = "lockstep"\nperiod_s = 0.02\n', encoding="utf-8")
    with running("sim", slave, "--listen-port", "0") as ready, independent_client(port_in(ready)) as client:
        for _ in range(round(PUSHED_S / 0.02)):
            client.write(SIMULATED_MAP.command_pa.address, list(struct.unpack(">HH", struct.pack(">f", PUSHED_PA))))
        (position_m,) = struct.unpack(">f", struct.pack(">HH", *client.read_input(0, 2)))
    return float(position_m)


def resting_m(valve: ValveFile) -> float:
    time_s = np.arange(0.0, PUSHED_S, 0.02)
    return float(simulate(valve, time_s, np.full(time_s.size, PUSHED_PA)).position_m[-1])


def test_a_curve_goes_through_its_heights_and_stays_level_beyond(tmp_path: Path) -> None:
    form = named("force_over_position_bump")
    values = {"force_n": 40.0, "place": 0.4, "width": 0.1, "travel_m": 0.1}
    curve, heights = curve_of(form, values, (0.05, 0.95))
    knots = [float(each.text.split()[-1]) for each in curve.quantities if each.key.startswith("height_")]
    assert heights == pytest.approx([np.exp(-(((s - 0.4) / 0.1) ** 2)) for s in knots], abs=2e-3)
    found = dict(zip([each.key for each in curve.quantities], (40.0, *heights, 0.1), strict=True))
    (tmp_path / "mine.py").write_text(form_text(curve, found), encoding="utf-8")
    effect = read_effect(tmp_path / "mine.py")
    laws = interpreted((effect,))

    def added_n(s: float, **changed: float) -> float:
        theta = [0.0] * 8 + [{**found, **changed}[key] for key in effect.parameters]
        return float(laws.force(0.0, laws.Stem(0.0, 0.1 * s, 0.0, 0.0), theta, ()))

    for s in np.linspace(0.1, 0.9, 33):
        assert added_n(s) == pytest.approx(force_n("force_over_position_bump", 0.1 * s, **values)[0], abs=0.6)
    assert [added_n(s, height_0=0.5) for s in (0.01, 0.05)] == pytest.approx([-20.0, -20.0])
    assert effect.off(SEED.valve)[:3] == (40.0, 0.0, 0.0), "it vanishes by its heights: what they are in units of stays"


def test_a_form_over_time_has_no_curve() -> None:
    assert not has_curve(named("scaled_over_time_rise"))
    assert has_curve(named("drag_over_speed_power"))


def test_where_nothing_is_left_no_form_is_sought(folder: Path) -> None:
    found = discover(record_of(BARE, 7, 1000), KNOWN, test=record_of(BARE, 8, 1000))
    assert (found.outcome, found.found) == ("explained", ())
    assert "nothing is left to explain" in found.sentence


@pytest.mark.parametrize("name", ["found.txt", "my-form.py", "a.b.py"])
def test_a_name_that_no_effect_can_have_is_refused_before_the_work(
    name: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(folder)
    assert main(["discover", "rec.csv", "--valve", "known.toml", "-o", name]) == 2
    assert "the file's name is the effect's" in capsys.readouterr().err

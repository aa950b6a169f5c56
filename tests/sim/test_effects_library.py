"""What every shipped effect has in common: it is declared, vanishes when off, shows when strong, and never diverges."""

import re
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.valve_file import ValveParameters, load_valve, shipped_valve
from sim.composition import BASE, Composition
from sim.effect import Effect, Parameter, find_effect, read_effect, scale_of
from sim.effects.__main__ import renew_catalogue
from sim.open_loop import respond
from sim.valve import Valve
from tests.sim.library import EFFECTS, SEED, Series, library, plain, theta_with
from workbench.model.search_coordinates import MOST_GRID

PATH = (
    "ip_lag dead_time rate_limit supply_limit",
    "preload spring_hardening area_variation flow_force end_stop quadratic_drag asymmetric_viscosity",
    "stribeck asymmetric_friction position_friction pressure_friction presliding dwell_stiction friction_drift",
    "pressure_power_friction presliding_hysteresis",
    "backlash sensor_offset sensor_gain sensor_nonlinearity sensor_lag quantisation",
)
DOCUMENT = Path(__file__).parents[2] / "docs" / "effects.md"
COMMANDS = np.repeat(np.array([30e3, 60e3, 58e3, 62e3, 20e3, 22e3, 80e3, 10e3, 40e3]), 200)
SMALL = ValveParameters(
    name="servo motor, in rad and N m",
    mass_kg=2e-4,
    diaphragm_area_m2=1.0,
    spring_n_per_m=1e-6,
    viscous_ns_per_m=2.5e-4,
    coulomb_n=0.03,
    static_n=0.03,
    stribeck_velocity_m_per_s=1.0,
    deadzone_ratio=0.6,
    stroke_m=38.0,
)
each_effect = pytest.mark.parametrize("effect", EFFECTS.values(), ids=EFFECTS)


def indicated(theta: Series) -> Series:
    return respond(library(), theta, COMMANDS, 1e-3, step_s=1e-4).indicated_m


def test_the_library_is_complete() -> None:
    assert set(EFFECTS) == set(" ".join(PATH).split())


@each_effect
def test_it_says_what_it_is(effect: Effect) -> None:
    assert effect.text.endswith(".")
    assert len(effect.text) < 120
    assert effect.equation
    assert effect.looks.endswith(".")
    assert effect.parameters


@each_effect
def test_what_it_is_confounded_with_says_the_same(effect: Effect) -> None:
    assert effect.confounded
    for name in effect.confounded:
        if name not in EFFECTS:
            assert name in BASE
            continue
        back = EFFECTS[name].confounded
        assert effect.name in back, f"{name} does not name {effect.name}"
        assert (effect.confounded[name] == "") == (back[effect.name] == "")


@each_effect
@pytest.mark.parametrize("valve", [SEED.valve, SMALL], ids=["valve", "motor"])
def test_off_and_every_start_are_physical(effect: Effect, valve: ValveParameters) -> None:
    for values in (effect.off(valve), *effect.strengths(valve)):
        written = dict(zip(effect.parameters, values, strict=True))
        assert effect.values(written, "start") == values
    assert 3 <= len(effect.strengths(SEED.valve)) <= MOST_GRID
    assert any(parameter.off is not None for parameter in effect.parameters.values())


@each_effect
def test_off_is_the_bare_valve(effect: Effect) -> None:
    commands, values = np.repeat(np.array([50e3, 80e3, 20e3]), 12), effect.off(SEED.valve)
    bare, off = (run(each, commands, 1e-3, 5e-4) for run, each in ((plain([]), ()), (plain([effect]), values)))
    assert np.ptp(bare[2]) > 1e-3
    if effect.name.startswith("presliding"):
        np.testing.assert_allclose(off, bare, rtol=1e-6, atol=1e-8)
    else:
        assert off.tolist() == bare.tolist()


@each_effect
def test_it_shows_and_a_strong_one_shows_more(effect: Effect) -> None:
    off = indicated(library().theta)
    weak, strong = (
        np.sqrt(np.mean((indicated(theta_with(effect, values)) - off) ** 2))
        for values in (effect.strengths(SEED.valve)[0], effect.strengths(SEED.valve)[-1])
    )
    assert weak < strong
    assert strong > 4e-4


@each_effect
def test_nothing_diverges_at_the_ends_of_a_range(effect: Effect) -> None:
    strong = dict(zip(effect.parameters, effect.strengths(SEED.valve)[-1], strict=True))
    for key, parameter in effect.parameters.items():
        for end in (parameter.least, parameter.most):
            answer = indicated(theta_with(effect, list({**strong, key: end}.values())))
            assert np.abs(answer).max() < 1e3, f"{key} = {end}"


@each_effect
def test_beyond_the_range_is_refused(effect: Effect) -> None:
    for key, parameter in effect.parameters.items():
        for beyond in (np.nextafter(parameter.least, -np.inf), np.nextafter(parameter.most, np.inf)):
            with pytest.raises(InputError, match=f"{key}: must be a number from "):
                Valve(library()).change(**{f"{effect.name}.{key}": float(beyond)})


@pytest.mark.parametrize(
    "parameter",
    [
        "stribeck.excess_n",
        "pressure_friction.growth_n_per_pa",
        "spring_hardening.cubic_n_per_m3",
        "quadratic_drag.drag_ns2_per_m2",
        "dwell_stiction.growth_n",
        "dead_time.dead_time_s",
    ],
)
def test_what_would_be_negative_is_unphysical(parameter: str) -> None:
    with pytest.raises(InputError, match="must be a number from 0 to"):
        Valve(library()).change(**{parameter: -1e-6})


def test_all_of_them_at_once() -> None:
    composition = library()
    on = {
        f"{each.name}.{key}": value
        for each in EFFECTS.values()
        for key, value in zip(each.parameters, each.strengths(SEED.valve)[1], strict=True)
    }
    on["dead_time.dead_time_s"] = 0.01
    response = respond(composition, composition.changed(composition.theta, on), COMMANDS, 1e-3)
    left = on["supply_limit.exhaust_pa"]
    assert (response.pressure_pa[:11] == left).all(), "the dead time passes nothing on yet"
    assert left < response.pressure_pa[20] < 30e3, "the lag behind it answers"
    assert response.pressure_pa.max() <= on["supply_limit.supply_pa"] < 80e3
    assert np.ptp(response.position_m) > 0.01
    assert np.isfinite(response.indicated_m).all()


def test_the_plain_text_with_effects_gives_the_compiled_numbers() -> None:
    effects = list(EFFECTS.values())
    strong = [value for each in effects for value in each.strengths(SEED.valve)[1]]
    commands = np.repeat(np.array([60e3, 30e3]), 5)
    names = library().names[len(BASE) :]
    theta = library().changed(library().theta, dict(zip(names, strong, strict=True)))
    compiled = respond(library(), theta, commands, 1e-3, step_s=5e-4)
    path = plain(effects)(strong, commands, 1e-3, 5e-4)
    np.testing.assert_allclose(path[4], compiled.indicated_m, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(path[1], compiled.pressure_pa, rtol=1e-9, atol=1e-9)


def test_starts_are_scaled_by_the_valve_and_stay_in_the_range() -> None:
    parameter = Parameter(
        "force", 0.0, 100.0, starts=(1.0, 2.0, 4.0, 5.0), scale="spring_n_per_m * stroke_m / static_n"
    )
    unit_of_seed = 52538.0 * 0.1016 / 1708.09
    assert parameter.starts_for(SEED.valve) == pytest.approx([unit_of_seed * k for k in (1, 2, 4, 5)])
    wide = Parameter("force", 0.0, 2e3, starts=(1.0, 2.0, 4.0), scale="coulomb_n")
    assert wide.starts_for(SEED.valve) == (1423.4, 2e3), "what lies beyond the range stands at its end, once"


HEAD = "from typing import Annotated, NamedTuple\nfrom sim.effect import Parameter\ndef force(q): return q.weight_n\n"


@pytest.mark.parametrize("scale", ["coulomb", "coulomb_n + static_n", "name", "coulomb_n *", "coulomb_n static_n"])
def test_a_scale_is_a_product_of_the_valve_s_numbers(tmp_path: Path, scale: str) -> None:
    with pytest.raises(ValueError, match=re.escape(repr(scale))):
        scale_of(scale, SEED.valve)
    path = tmp_path / "weight.py"
    declared = f"Annotated[float, Parameter('weight', 0.0, 1e3, starts=(1.0,), scale={scale!r})]"
    path.write_text(f"{HEAD}class Parameters(NamedTuple):\n    weight_n: {declared}\n")
    with pytest.raises(InputError, match=r"weight\.py: Parameters\.weight_n: scale must be a product") as refusal:
        read_effect(path).strengths(SEED.valve)
    assert scale in str(refusal.value)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("LOOKS = ('a', 'b')", "LOOKS: must be a text, got"),
        ("CONFOUNDED = ('ip_lag',)", "CONFOUNDED: must give a text for each name, got"),
        ("CONFOUNDED = {'ip_lag': None}", "CONFOUNDED: must give a text for each name, got"),
    ],
)
def test_what_it_says_of_itself_is_text(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "own.py"
    path.write_text(f"{text}\ndef force(x): return x\n")
    with pytest.raises(InputError, match=re.escape(f"own.py: {expected}")):
        read_effect(path)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"import sys\nsys.exit(0)\n", "line 2: SystemExit: 0"),
        (b"# weight\n# of 5 \xb5g\n", "line 2: is not UTF-8 text, as Python is"),
    ],
)
def test_a_program_that_ends_or_is_no_text_is_one_line(tmp_path: Path, content: bytes, said: str) -> None:
    path = tmp_path / "own.py"
    path.write_bytes(content)
    with pytest.raises(InputError) as refusal:
        read_effect(path)
    assert str(refusal.value) == f"{path}: {said}"


def test_an_effect_without_starts_can_be_simulated_but_not_fitted(tmp_path: Path) -> None:
    path = tmp_path / "weight.py"
    path.write_text(
        "from typing import Annotated, NamedTuple\nfrom sim.effect import Parameter\n"
        "class Parameters(NamedTuple):\n    mass_kg: Annotated[float, Parameter('mass', 0.0, 1e3)]\n"
        "def force(q): return 9.81 * q.mass_kg\n"
    )
    effect = read_effect(path)
    with pytest.raises(InputError, match=r"weight\.py: Parameters\.mass_kg: declares no starts"):
        effect.strengths(SEED.valve)
    assert (effect.text, effect.looks, effect.confounded, effect.equation) == ("", "", {}, "")


def test_the_document_has_the_catalogue_of_today() -> None:
    document = DOCUMENT.read_text(encoding="utf-8")
    assert document == renew_catalogue(document), "stale: run python -m sim.effects docs/effects.md"
    for name in EFFECTS:
        assert f"### {name}\n" in document


def test_the_document_s_own_effect_runs_from_a_valve_file(tmp_path: Path) -> None:
    document = DOCUMENT.read_text(encoding="utf-8")
    code = re.findall(r"```python\n(.*?)```", document, re.DOTALL)
    tables = re.findall(r"```toml\n(.*?)```", document, re.DOTALL)
    (tmp_path / "tight_spot.py").write_text(code[0])
    path = tmp_path / "plant.toml"
    path.write_text(shipped_valve("seed").read_text() + tables[1])
    valve = Valve.from_file(load_valve(path), source=str(path))
    for position_m, excess_n in ((0.04, 600.0), (0.02, 0.0)):
        balance_n = SEED.valve.spring_n_per_m * position_m + SEED.valve.static_n + excess_n
        for factor, moves in ((0.9999, False), (1.0001, True)):
            valve.rest_at(position_m)
            valve.advance(factor * balance_n / SEED.valve.diaphragm_area_m2, 5e-3)
            assert (valve.position_m != position_m) == moves
    effect = find_effect(str(tmp_path / "tight_spot.py"), "--effect")
    assert len(effect.strengths(SEED.valve)) == 12
    assert "tight spot" in effect.text


def test_an_own_effect_that_is_not_there_is_named(tmp_path: Path) -> None:
    path = tmp_path / "plant.toml"
    path.write_text(shipped_valve("seed").read_text() + '[[effect]]\nname = "./mine.py"\n')
    with pytest.raises(InputError, match=r"plant\.toml: no effect's file .*mine\.py") as refusal:
        Composition.from_file(load_valve(path), str(path))
    assert str(tmp_path / "mine.py") in str(refusal.value)

"""Each effect against a truth computed by hand, and what an effect's file and table may say."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config.errors import InputError
from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim.composition import Composition
from sim.effect import read_effect, shipped_effect, shipped_effects
from sim.valve import Valve

SEED = load_valve(shipped_valve("seed"))
A, k_s = SEED.valve.diaphragm_area_m2, SEED.valve.spring_n_per_m
F_c, F_s = SEED.valve.coulomb_n, SEED.valve.static_n
COMMANDS = np.repeat(np.array([30e3, 55e3, 20e3, 45e3, 0.0]), 100)


def file_with(*tables: dict[str, Any]) -> ValveFile:
    return ValveFile(valve=SEED.valve, effect=tuple(EffectTable.model_validate(each) for each in tables))


def valve_with(*tables: dict[str, Any]) -> Valve:
    return Valve.from_file(file_with(*tables))


LAG = {"name": "ip_lag", "time_constant_s": 0.05}
PLAY = {"name": "backlash", "width_m": 1e-3}
PRESLIDING = {"name": "presliding", "stiffness_n_per_m": 8e6}
ASYMMETRY = {"name": "asymmetric_friction", "asymmetry": 0.1}
STOP = {
    "name": "end_stop",
    "lower_m": 0.0,
    "travel_m": 0.1016,
    "stiffness_n_per_m": 1e8,
    "damping_ns_per_m": 1e4,
}


def test_ip_lag_rises_and_falls_exponentially() -> None:
    response = valve_with(LAG).run(np.repeat([20e3, 0.0], 100), 1e-3)
    t = response.time_s
    top = 20e3 * (1.0 - math.exp(-2.0))
    np.testing.assert_allclose(response.pressure_pa[:101], 20e3 * (1.0 - np.exp(-t[:101] / 0.05)), rtol=1e-11)
    np.testing.assert_allclose(response.pressure_pa[100:], top * np.exp(-(t[100:] - 0.1) / 0.05), rtol=1e-11)


@pytest.mark.parametrize(("direction", "level"), [(1.0, 1.1), (-1.0, 0.9)])
def test_asymmetric_friction_breaks_away_at_its_own_level(direction: float, level: float) -> None:
    valve = valve_with(ASYMMETRY)
    for factor, moves in ((0.999, False), (1.001, True)):
        valve.rest_at(0.05)
        valve.advance((k_s * 0.05 + direction * level * F_s * factor) / A, 0.3)
        assert (valve.position_m != 0.05) == moves
    left = direction * (valve.pressure_pa * A - k_s * valve.position_m)
    assert left == pytest.approx(level * F_c, abs=15.0), "it glides until F_e is down to Coulomb friction"


def test_presliding_yields_elastically_and_returns() -> None:
    valve = valve_with(PRESLIDING)
    response = valve.run([10e3, 20e3, 5e3, 0.0], 1e-5)
    expected = A * np.array([0.0, 10e3, 20e3, 5e3, 0.0]) / (k_s + 8e6)
    np.testing.assert_allclose(response.position_m, expected, rtol=1e-6, atol=1e-13)
    assert not response.velocity_m_per_s.any()


def test_presliding_leaves_break_away_where_it_is() -> None:
    valve = valve_with(PRESLIDING)
    creep = F_s / 8e6
    at_limit = (F_s + k_s * creep) / A
    valve.run(np.linspace(0.0, 0.9999 * at_limit, 1000), 1e-3)
    assert valve.position_m == pytest.approx(creep, rel=1e-3)
    valve.advance(1.0001 * at_limit, 0.1)
    assert valve.position_m > 10 * creep


def test_presliding_yields_from_where_the_stem_stuck() -> None:
    valve = valve_with(PRESLIDING)
    valve.advance(60e3, 0.5)
    stuck = valve.position_m
    valve.advance(59e3, 0.1)
    assert valve.position_m - stuck == pytest.approx(-A * 1e3 / (k_s + 8e6), rel=1e-6)


def test_backlash_follows_half_a_play_behind() -> None:
    valve = valve_with(PLAY)
    up = valve.run(np.linspace(0.0, 60e3, 600), 1e-3)
    assert up.indicated_m[0] == 0.0
    assert up.indicated_m[-1] == pytest.approx(up.position_m[-1] - 0.5e-3, abs=1e-12)
    valve.advance(60e3, 1.0)
    top = valve.position_m
    down = valve.run(np.linspace(60e3, 0.0, 600), 1e-3)
    within = (down.position_m < top) & (down.position_m > top - 1e-3)
    assert within.any()
    assert (down.indicated_m[within] == top - 0.5e-3).all()
    assert down.indicated_m[-1] == pytest.approx(down.position_m[-1] + 0.5e-3, abs=1e-12)


def test_the_end_stop_holds_the_stem_and_the_bare_valve_runs_on() -> None:
    stopped, bare = valve_with(STOP), valve_with()
    for valve in (stopped, bare):
        valve.advance(200e3, 1.0)
    depth = stopped.position_m - 0.1016
    push = A * 200e3 - k_s * stopped.position_m
    assert 0.0 < depth < 1e-4
    assert abs(push - 1e8 * depth) <= F_s
    assert stopped.velocity_m_per_s == 0.0
    assert bare.position_m == pytest.approx((A * 200e3 - F_c) / k_s, rel=2e-3)


def test_the_end_stop_never_pulls() -> None:
    valve = valve_with(STOP)
    valve.advance(200e3, 1.0)
    valve.advance(0.0, 1.0)
    assert valve.position_m == pytest.approx(F_c / k_s, rel=0.02), "it leaves the stop as if there were none"
    valve.advance(-100e3, 1.0)
    assert -1e-4 < valve.position_m < 0.0


def test_off_is_bit_for_bit_the_bare_valve() -> None:
    bare = valve_with().run(COMMANDS, 1e-3)
    neutral = valve_with({"name": "asymmetric_friction", "asymmetry": 0.0}).run(COMMANDS, 1e-3)
    sensor_only = valve_with(PLAY).run(COMMANDS, 1e-3)
    far_stops = valve_with({**STOP, "lower_m": -1.0, "travel_m": 2.0}).run(COMMANDS, 1e-3)
    assert np.ptp(bare.position_m) > 0.03
    for response in (neutral, sensor_only, far_stops):
        assert response.position_m.tolist() == bare.position_m.tolist()
        assert response.velocity_m_per_s.tolist() == bare.velocity_m_per_s.tolist()
    assert sensor_only.indicated_m.tolist() != bare.indicated_m.tolist()
    assert neutral.indicated_m.tolist() == bare.position_m.tolist()


def test_effects_stand_together() -> None:
    together = valve_with(LAG, ASYMMETRY, PRESLIDING, PLAY, STOP)
    response = together.run(np.full(1000, 60e3), 1e-3)
    assert response.pressure_pa[50] == pytest.approx(60e3 * (1.0 - math.exp(-1.0)), rel=1e-11)
    assert response.indicated_m[-1] == pytest.approx(response.position_m[-1] - 0.5e-3, abs=1e-12)
    left = A * 60e3 - k_s * response.position_m[-1]
    assert 1.1 * F_c < left < 1.1 * F_s
    before = response.position_m[-1]
    together.run(np.full(1000, 59e3), 1e-3)
    assert together.position_m - before == pytest.approx(-A * 1e3 / (k_s + 8e6), rel=1e-2)


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({"name": "ip_lagg", "time_constant_s": 1.0}, "no effect named 'ip_lagg'; there are: area_variation, "),
        ({"name": "ip_lag", "tau_s": 1.0}, "tau_s: unknown parameter of ip_lag; allowed: time_constant_s"),
        ({"name": "ip_lag"}, "time_constant_s: is required by ip_lag and missing; it is a number from 0 to 60"),
        ({"name": "ip_lag", "time_constant_s": -1.0}, "must be a number from 0 to 60 (time constant), got -1.0"),
        ({"name": "ip_lag", "time_constant_s": "fast"}, "time constant), got 'fast'"),
        ({"name": "ip_lag", "time_constant_s": True}, "time constant), got True"),
        ({"name": "ip_lag", "time_constant_s": math.nan}, "time constant), got nan"),
    ],
)
def test_a_wrong_table_is_named_in_one_line(table: dict[str, Any], expected: str) -> None:
    file = ValveFile.model_construct(valve=SEED.valve, effect=(EffectTable.model_construct(None, **table),))
    with pytest.raises(InputError) as refusal:
        Valve.from_file(file, source="plant.toml")
    assert expected in str(refusal.value)
    assert str(refusal.value).startswith("plant.toml: ")
    assert "\n" not in str(refusal.value)


def test_an_effect_stands_once() -> None:
    with pytest.raises(InputError, match="effect ip_lag stands 2 times; once is allowed"):
        valve_with(LAG, LAG)


def test_every_shipped_effect_declares_itself() -> None:
    for name in shipped_effects():
        effect = shipped_effect(name, "test")
        assert effect.text.endswith("."), name
        for key, parameter in effect.parameters.items():
            assert parameter.least < parameter.most, f"{name}.{key}"


HEAD = "from typing import Annotated, NamedTuple\nfrom sim.effect import Parameter\n"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("def force(x:", "line 1: "),
        ("1 / 0", "ZeroDivisionError"),
        ("def push(x): return x", "defines none of the places pressure, force, friction, motion, sensor"),
        ("def force(speed): return speed", "force: unknown argument speed; allowed: t, x, v, p, q, z"),
        ("def sensor(y): return y\ndef force(x): return x", "sensor must be an effect's only place"),
        ("MEMORY = 1\ndef force(x): return x", "start and advance belong with MEMORY"),
        ("MEMORY = -1\ndef force(x): return x", "MEMORY: must be a whole number from 0 to 100000, got -1"),
        ("MEMORY = 'a'\ndef force(x): return x", "MEMORY: must be a whole number from 0 to 100000, got 'a'"),
        ("MEMORY = 10**9\ndef force(x): return x", "MEMORY: must be a whole number from 0 to 100000, got 1000000000"),
        ("def force(x): return x\ndef straight(h): return h", "straight belongs in the pressure path, got force"),
        ("STEP_S = 0\ndef force(x): return x", "STEP_S: must be a time in seconds above 0.0, got 0"),
        (
            "from typing import NamedTuple\nclass Parameters(NamedTuple):\n    k: float\ndef force(x): return x",
            "Parameters.k: must be Annotated",
        ),
        (
            HEAD + "class Parameters(NamedTuple):\n    k: Annotated[float, Parameter('k', 0.0, 1.0, guess='swpt')]\n"
            "def force(x): return x",
            "Parameters.k: guess must be one of lowest, swept, quantum, delay, lag, got 'swpt'",
        ),
    ],
)
def test_a_wrong_effect_file_is_named_in_one_line(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "own.py"
    path.write_text(text)
    with pytest.raises(InputError) as refusal:
        read_effect(path)
    assert expected in str(refusal.value)
    assert str(refusal.value).startswith(f"{path}: ")
    assert "\n" not in str(refusal.value)


def test_an_effect_that_numba_cannot_compile_is_named(tmp_path: Path) -> None:
    path = tmp_path / "own.py"
    path.write_text("def force(x):\n    return open(str(x)).read()\n")
    with pytest.raises(InputError, match=r"own\.py: cannot be compiled: ") as refusal:
        Composition.of(file_with({"name": "own"}), [read_effect(path)])
    assert "\n" not in str(refusal.value)
    assert "Untyped global name 'open'" in str(refusal.value)
    assert "def force(x): return open(str(x)).read()" in str(refusal.value)
    assert len(str(refusal.value)) < 500


def test_an_own_effect_in_one_file(tmp_path: Path) -> None:
    path = tmp_path / "weight.py"
    path.write_text(
        '"""Weight."""\n'
        + HEAD
        + "class Parameters(NamedTuple):\n"
        + '    mass_kg: Annotated[float, Parameter("hanging mass", 0.0, 1e3)]\n'
        + "def gravity(mass): return 9.81 * mass\n"
        + "def force(q): return gravity(q.mass_kg)\n"
    )
    composition = Composition.of(file_with({"name": "weight", "mass_kg": 100.0}), [read_effect(path)])
    valve = Valve(composition)
    valve.advance((F_s - 982.0) / A, 0.01)
    assert valve.position_m == 0.0
    valve.advance((F_s - 980.0) / A, 0.01)
    assert valve.position_m > 0.0


NO_NUMBER = {
    "NaN at rest": "def force(x): return math.nan",
    "NaN on the way": "def force(x): return math.sqrt(0.03 - x)",
    "infinite": "def force(x): return 1.0 / (x - x)",
    "an infinite slope": "def force(x): return math.log(x)",
    "of friction": "def friction(F_c, F_s, x): return F_c, F_s * math.sqrt(0.03 - x)",
    "of the pressure": "def pressure(u): return math.sqrt(60e3 - u)",
    "of the indication": "def sensor(y): return math.sqrt(0.03 - y)",
    "for a while between two samples": "def force(x, t): return 0.0 * math.sqrt(abs(t - 0.105) - 0.002)",
    "a friction without end": "def friction(F_c, F_s, x): return F_c, F_s / (x - x)",
}


@pytest.mark.parametrize("text", NO_NUMBER.values(), ids=NO_NUMBER)
def test_a_valve_of_which_nobody_can_say_where_it_is_has_no_answer(tmp_path: Path, text: str) -> None:
    path = tmp_path / "own.py"
    path.write_text(f"import math\n{text}\n")
    valve = Valve(Composition.of(file_with({"name": "own"}), [read_effect(path)], "v.toml"), step_s=1e-3)
    with pytest.raises(InputError, match=r"^v\.toml: nobody can say where the stem is from .* its effects: own$"):
        valve.run(np.linspace(0.0, 90e3, 50), 0.01)


def test_a_force_that_outgrows_every_step_ends(tmp_path: Path) -> None:
    path = tmp_path / "own.py"
    path.write_text("def force(x): return 1e30 * (x + 1.0)\n")
    valve = Valve(Composition.of(file_with({"name": "own"}), [read_effect(path)], "v.toml"), step_s=1e-3)
    with pytest.raises(InputError, match="nobody can say"):
        valve.run(np.full(3, 50e3), 1e-3)

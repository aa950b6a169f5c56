"""The valve as the other rooms use it."""

import math
from copy import deepcopy
from dataclasses import fields

import numpy as np
import pytest

from config.errors import InputError
from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim import karnopp, open_loop
from sim.composition import Composition
from sim.open_loop import respond
from sim.valve import Valve

SEED = load_valve(shipped_valve("seed"))
LAGGED = ValveFile(valve=SEED.valve, effect=(EffectTable.model_validate({"name": "ip_lag", "time_constant_s": 0.05}),))
COMMANDS = np.repeat([30e3, 55e3, 20e3, 45e3], 40)


def test_advance_in_pieces_is_run() -> None:
    pieces, whole = Valve.from_file(SEED), Valve.from_file(SEED)
    response = whole.run(COMMANDS, 2.5e-3)
    for i, command in enumerate(COMMANDS):
        assert (pieces.time_s, pieces.position_m) == (response.time_s[i], response.position_m[i])
        pieces.advance(float(command), 2.5e-3)
    for name in ("time_s", "position_m", "velocity_m_per_s", "pressure_pa", "indicated_m"):
        assert getattr(pieces, name) == getattr(whole, name) == getattr(response, name)[-1]


def test_a_run_is_the_same_however_it_is_cut_into_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    """Long periods and short ones: a call takes so many steps or rows, and one period where that alone is more."""
    apart_s = np.tile([1e-4, 3e-3, 1e-5, 0.2, 1e-4, 1e-4], 6)
    command_pa = np.linspace(0.0, 90e3, apart_s.size)
    whole = Valve.from_file(SEED).run(command_pa, apart_s)
    monkeypatch.setattr(open_loop, "STEPS_AT_ONCE", 320)
    monkeypatch.setattr(open_loop, "PERIODS_AT_ONCE", 4)
    cut = Valve.from_file(SEED).run(command_pa, apart_s)
    assert whole.position_m[-1] > 0.0
    for name in ("time_s", "pressure_pa", "position_m", "velocity_m_per_s", "indicated_m"):
        np.testing.assert_array_equal(getattr(cut, name), getattr(whole, name))


def test_a_stem_too_stiff_to_be_followed_has_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    """A drag of 8e7 N (m/s)^-0.5: its damping is infinite where the stem begins to move."""

    def drag(F: float, stem: karnopp.Stem, _q: object, _z: object) -> float:
        return F - 8e7 * math.copysign(math.sqrt(abs(stem.v)), stem.v)

    monkeypatch.setattr(karnopp, "force", drag)
    monkeypatch.setattr(karnopp, "MOST_MODE_CHANGES", 20)
    monkeypatch.setattr(karnopp, "MOST_SUBSTEPS", 200)
    valve = karnopp.karnopp(Composition.from_file(SEED).theta)
    x, v, _, _ = karnopp.step(valve, karnopp.Drive(0.0, 60e3, 0.0), 0.01, 0.02, 0.0, 0, 0.0, 1e-5, False, None, None)
    assert math.isnan(x)
    assert math.isnan(v)


def test_rows_are_the_start_and_the_ends_of_the_periods() -> None:
    valve = Valve.from_file(SEED)
    valve.rest_at(0.02, 25e3)
    response = valve.run([30e3, 40e3, 50e3], [1e-3, 2e-3, 4e-3])
    assert {getattr(response, each.name).shape for each in fields(response)} == {(4,)}
    np.testing.assert_allclose(response.time_s, [0.0, 1e-3, 3e-3, 7e-3], rtol=1e-14)
    assert response.command_pa.tolist() == [30e3, 40e3, 50e3, 50e3]
    assert response.pressure_pa.tolist() == [25e3, 30e3, 40e3, 50e3]
    assert response.position_m[0] == response.indicated_m[0] == 0.02


def test_a_run_goes_on_where_the_last_one_ended() -> None:
    valve, whole = Valve.from_file(LAGGED), Valve.from_file(LAGGED)
    first, second = valve.run(COMMANDS[:70], 1e-3), valve.run(COMMANDS[70:], 1e-3)
    response = whole.run(COMMANDS, 1e-3)
    assert np.concatenate([first.position_m, second.position_m[1:]]).tolist() == response.position_m.tolist()
    assert first.time_s[-1] == second.time_s[0]


def test_a_copy_moves_by_itself() -> None:
    valve = Valve.from_file(SEED)
    valve.advance(60e3, 0.05)
    before_m, copied = valve.position_m, deepcopy(valve)
    copied.advance(90e3, 0.05)
    assert valve.position_m == before_m
    valve.advance(90e3, 0.05)
    assert copied.position_m == valve.position_m > before_m


def test_a_period_that_is_no_multiple_of_the_step() -> None:
    odd, fine = Valve.from_file(SEED), Valve.from_file(SEED, step_s=1e-6)
    for valve in (odd, fine):
        for _ in range(40):
            valve.advance(50e3, 1.2345e-3)
    assert odd.time_s == pytest.approx(40 * 1.2345e-3, rel=1e-12)
    assert odd.position_m == pytest.approx(fine.position_m, abs=1e-9)


def test_the_plain_python_text_gives_the_compiled_numbers() -> None:
    composition = Composition.from_file(SEED)
    commands, periods = COMMANDS[::16].copy(), np.full(10, 2e-3)
    plain, compiled = np.empty((5, 11)), np.empty((5, 11))
    for function, path in ((karnopp.respond, plain), (composition.kernel.respond, compiled)):
        state = np.zeros(composition.kernel.state_size)
        function(composition.theta.copy(), state, commands, periods, 1e-5, karnopp.TOLERANCE, path)
    assert plain[2, -1] > 1e-3
    assert plain.tolist() == compiled.tolist()


def test_by_default_it_rests_where_the_spring_is_balanced() -> None:
    valve = Valve.from_file(LAGGED)
    valve.rest_at(0.05)
    balance = SEED.valve.spring_n_per_m * 0.05 / SEED.valve.diaphragm_area_m2
    assert valve.pressure_pa == pytest.approx(balance, rel=1e-12)
    valve.advance(balance, 0.1)
    assert valve.position_m == valve.indicated_m == 0.05


def test_friction_ages_while_it_runs() -> None:
    valve = Valve.from_file(SEED)
    just_enough = 1.01 * SEED.valve.static_n / SEED.valve.diaphragm_area_m2
    valve.change(coulomb_n=1.2 * SEED.valve.coulomb_n, static_n=1.2 * SEED.valve.static_n)
    valve.advance(just_enough, 0.1)
    assert valve.position_m == 0.0
    valve.change(coulomb_n=SEED.valve.coulomb_n, static_n=SEED.valve.static_n)
    valve.advance(just_enough, 0.1)
    assert valve.position_m > 1e-3


def test_an_effect_changes_while_it_runs() -> None:
    valve = Valve.from_file(LAGGED)
    valve.advance(10e3, 0.05)
    valve.change(**{"ip_lag.time_constant_s": 0.01})
    valve.advance(10e3, 0.01)
    assert valve.pressure_pa == pytest.approx(10e3 * (1.0 - math.exp(-2.0)), rel=1e-12)


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({"static_n": 1000.0}, "static_n must be at least coulomb_n"),
        ({"mass_kg": -1.0}, "mass_kg"),
        ({"friction": 1.0}, "friction: unknown parameter; there are: mass_kg, "),
        ({"ip_lag.time_constant_s": 1e9}, "time_constant_s: must be a number from 0 to 60"),
    ],
)
def test_an_unphysical_change_is_refused_and_changes_nothing(parameters: dict[str, float], expected: str) -> None:
    valve, untouched = Valve.from_file(LAGGED, source="plant.toml"), Valve.from_file(LAGGED)
    with pytest.raises(InputError, match=expected) as refusal:
        valve.change(**parameters)
    assert str(refusal.value).startswith("plant.toml: ")
    assert "\n" not in str(refusal.value)
    assert valve.run(COMMANDS, 1e-3).position_m.tolist() == untouched.run(COMMANDS, 1e-3).position_m.tolist()


def test_the_fast_path_is_the_valve() -> None:
    composition = Composition.from_file(LAGGED)
    theta = composition.changed(composition.theta, {"coulomb_n": 1200.0, "ip_lag.time_constant_s": 0.02})
    assert dict(zip(composition.names, theta.tolist(), strict=True))["coulomb_n"] == 1200.0
    response = respond(composition, theta, COMMANDS, 1e-3, position_m=0.01, pressure_pa=8e3)
    valve = Valve.from_file(LAGGED)
    valve.change(**{"coulomb_n": 1200.0, "ip_lag.time_constant_s": 0.02})
    valve.rest_at(0.01, 8e3)
    assert response.position_m.tolist() == valve.run(COMMANDS, 1e-3).position_m.tolist()


def test_what_cannot_be_simulated_is_refused() -> None:
    valve = Valve.from_file(SEED)
    for command, duration in ((math.nan, 1e-3), (1e4, 0.0), (1e4, math.inf)):
        with pytest.raises(ValueError, match="cannot hold"):
            valve.advance(command, duration)
    with pytest.raises(ValueError, match="command_pa"):
        valve.run([1e4, math.nan], 1e-3)
    with pytest.raises(ValueError, match="period_s"):
        valve.run([1e4, 1e4], [1e-3, -1e-3])
    with pytest.raises(ValueError, match="step_s"):
        Valve.from_file(SEED, step_s=0.0)
    with pytest.raises(ValueError, match="finite"):
        valve.rest_at(math.inf)
    composition = Composition.from_file(SEED)
    with pytest.raises(ValueError, match="theta must have the 8 entries mass_kg, "):
        respond(composition, composition.theta[:5], [1e4], 1e-3)
    assert valve.time_s == valve.position_m == 0.0

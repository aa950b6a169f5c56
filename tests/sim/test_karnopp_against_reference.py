"""The compiled valve against scipy's integration of the automaton, and against what mechanics demands."""

import math
from collections.abc import Callable

import numpy as np
import pytest

from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim import karnopp
from sim.composition import Composition
from sim.open_loop import at_rest, follow
from sim.valve import Valve
from tests.sim.reference import Reference, Series

PSI = 6894.757
LIMIT_M = 1e-6
SEED = load_valve(shipped_valve("seed"))


def changed(**parameters: float) -> ValveFile:
    return ValveFile(valve=SEED.valve.model_copy(update=parameters))


def staircase(step_pa: float) -> Series:
    up = np.arange(20e3, 80e3, step_pa)
    return np.concatenate([up, up[::-1]])


def held_reference(file: ValveFile, levels: Series, hold_s: float) -> Reference:
    breaks = [k * hold_s for k in range(len(levels) + 1)]
    return Reference(file.valve, breaks, [constant(float(p)) for p in levels])


def constant(p: float) -> Callable[[float], float]:
    return lambda _: p


def test_the_seed_scenario_under_the_true_sine() -> None:
    t = np.arange(80001) * 1e-5
    reference = Reference(SEED.valve, [0.0, 0.8], [lambda t: (6.4 + 1.92 * math.sin(t)) * PSI])
    expected = reference.solve(t)
    middle = 0.5 * (t[:-1] + t[1:])
    response = Valve.from_file(SEED).run((6.4 + 1.92 * np.sin(middle)) * PSI, 1e-5)
    assert [mode for _, mode in reference.changes] == ["breaking", "slip"]
    assert np.abs(response.position_m - expected).max() < 1e-9
    at_start = Valve.from_file(SEED).run((6.4 + 1.92 * np.sin(t[:-1])) * PSI, 1e-5)
    assert np.abs(at_start.position_m - expected).max() < LIMIT_M


@pytest.mark.parametrize(
    ("file", "step_pa", "slips"),
    [
        pytest.param(SEED, 3e3, 10, id="slips at every other step"),
        pytest.param(SEED, 6e3, 9, id="slips at every step"),
        pytest.param(changed(static_n=2600.0, viscous_ns_per_m=100.0), 3e3, 2, id="long jumps, little damping"),
    ],
)
def test_a_stick_slip_staircase(file: ValveFile, step_pa: float, slips: int) -> None:
    levels, hold_s = staircase(step_pa), 0.12
    periods = round(hold_s / 1e-3)
    reference = held_reference(file, levels, hold_s)
    expected = reference.solve(np.arange(levels.size * periods + 1) * 1e-3)
    response = Valve.from_file(file).run(np.repeat(levels, periods), 1e-3)
    assert reference.times_of("slip").size == reference.times_of("stuck").size >= slips
    assert np.abs(response.position_m - expected).max() < LIMIT_M / 100.0


def test_a_swinging_stem_reverses_without_sticking() -> None:
    file = changed(coulomb_n=100.0, static_n=150.0, viscous_ns_per_m=20.0)
    levels = np.array([50e3, 20e3, 60e3])
    reference = held_reference(file, levels, 0.4)
    expected = reference.solve(np.arange(1201) * 1e-3)
    response = Valve.from_file(file).run(np.repeat(levels, 400), 1e-3)
    assert reference.times_of("slip").size > 2 * reference.times_of("stuck").size
    # Slowing through the band near the falling branch's unstable balance magnifies any error.
    assert np.abs(response.position_m - expected).max() < LIMIT_M / 10.0


def test_break_away_and_stick_are_located_inside_the_step() -> None:
    # A lagged pressure passes F_s / A in the middle of a step of 1 ms: to break away at its end would be 1e-4 m off.
    lag_s, target_pa = 0.05, 60e3
    lagged = ValveFile(
        valve=SEED.valve,
        effect=(EffectTable.model_validate({"name": "ip_lag", "time_constant_s": lag_s}),),
    )
    reference = Reference(SEED.valve, [0.0, 0.5], [lambda t: -target_pa * math.expm1(-t / lag_s)])
    expected = reference.solve(np.arange(501) * 1e-3)
    break_away = reference.times_of("breaking")[0] / 1e-3
    assert 0.1 < break_away % 1.0 < 0.9
    assert reference.times_of("stuck").size == 1

    def worst(step_s: float) -> float:
        response = Valve.from_file(lagged, step_s=step_s).run(np.full(500, target_pa), 1e-3)
        return float(np.abs(response.position_m - expected).max())

    assert worst(1e-3) < 3e-5
    assert worst(1e-4) < LIMIT_M
    assert worst(1e-5) < LIMIT_M / 100.0


def test_coarse_steps_keep_the_accuracy() -> None:
    commands = np.repeat(staircase(3e3), 120)
    fine = Valve.from_file(SEED, step_s=1e-5).run(commands, 1e-3).position_m
    coarse = Valve.from_file(SEED, step_s=1e-3).run(commands, 1e-3).position_m
    assert np.abs(coarse - fine).max() < 1e-7


@pytest.mark.parametrize(
    "file",
    [
        pytest.param(changed(viscous_ns_per_m=100.0), id="it swings"),
        pytest.param(SEED, id="barely damped"),
        pytest.param(changed(viscous_ns_per_m=2000.0), id="stiff"),
        pytest.param(changed(viscous_ns_per_m=30e3), id="so stiff that the pair would take 0.1 ms"),
    ],
)
def test_exponential_steps_over_whole_periods_keep_the_accuracy(file: ValveFile) -> None:
    assert off_by_exponential_m(file) < 2e-6


def test_an_exponential_step_through_a_bent_force_is_checked() -> None:
    bent = ValveFile(
        valve=changed(viscous_ns_per_m=2000.0).valve,
        effect=(EffectTable.model_validate({"name": "spring_hardening", "cubic_n_per_m3": 3e7}),),
    )
    assert off_by_exponential_m(bent) < 5e-6


@pytest.mark.parametrize(
    ("viscous_ns_per_m", "force_ns_per_m", "mass_kg"),
    [
        pytest.param(2e3, 150e3, SEED.valve.mass_kg, id="damps"),
        pytest.param(12e3, -10e3, 0.03, id="drives a light one"),
    ],
)
def test_a_force_by_velocity_takes_as_few_sub_steps_as_viscous_friction(
    monkeypatch: pytest.MonkeyPatch, viscous_ns_per_m: float, force_ns_per_m: float, mass_kg: float
) -> None:
    """The automaton as it stands, without compiler: forces for which the pair would take 10 us."""
    asked = []

    def velocity_force(_F: float, stem: karnopp.Stem, _q: object, _z: object) -> float:
        asked.append(stem)
        return -force_ns_per_m * stem.v

    file = changed(viscous_ns_per_m=viscous_ns_per_m, mass_kg=mass_kg)
    valve = karnopp.karnopp(Composition.from_file(file).theta)
    begin = (0.05, 0.02, karnopp.SLIP, 1.0, 1e-5, False, None, None)
    drive = karnopp.Drive(0.0, 90e3, 0.0)
    x, v, *_ = karnopp.step(valve._replace(F_v=viscous_ns_per_m + force_ns_per_m), drive, 0.01, *begin)
    monkeypatch.setattr(karnopp, "force", velocity_force)
    assert karnopp.step(valve, drive, 0.01, *begin) == pytest.approx((x, v, karnopp.SLIP, 1.0), rel=1e-5)
    assert len(asked) < 100


def test_a_stem_that_a_ramp_presses_into_a_stop_creeps_in_balance(monkeypatch: pytest.MonkeyPatch) -> None:
    """The automaton as it stands: over steps of 0.2 ms it breaks and sticks, over 2 ms it creeps."""
    asked, wall_m, stop_n_per_m = [], 0.05, 1e8

    def stop(_F: float, stem: karnopp.Stem, _q: object, _z: object) -> float:
        asked.append(stem)
        return -stop_n_per_m * max(stem.x - wall_m, 0.0)

    monkeypatch.setattr(karnopp, "force", stop)
    valve = karnopp.karnopp(Composition.from_file(SEED).theta)
    begin_m, rate_pa_per_s, duration_s = wall_m + 1e-6, 5e3, 0.02
    begin_pa = (valve.k_s * begin_m + stop_n_per_m * 1e-6 + valve.F_s) / valve.A

    def pressed(step_s: float) -> tuple[float, int]:
        asked.clear()
        x, v, mode, sigma = begin_m, 0.0, karnopp.STUCK, 0.0
        for k in range(round(duration_s / step_s)):
            drive = karnopp.Drive(k * step_s, begin_pa + rate_pa_per_s * k * step_s, rate_pa_per_s)
            x, v, mode, sigma = karnopp.step(valve, drive, step_s, x, v, mode, sigma, 1e-5, False, None, None)
        return x, len(asked)

    balanced_m = begin_m + valve.A * rate_pa_per_s * duration_s / (stop_n_per_m + valve.k_s)
    (fine_m, of_fine), (coarse_m, of_coarse) = pressed(0.2e-3), pressed(2e-3)
    assert coarse_m == pytest.approx(balanced_m, abs=1e-12)
    assert fine_m == pytest.approx(balanced_m, abs=1e-8)
    assert of_coarse < 200 < of_fine


def off_by_exponential_m(file: ValveFile) -> float:
    """Return how far a run over whole periods of 10 ms is from one in steps of 10 us, at most."""
    commands = np.repeat(staircase(6e3), 20)
    expected = Valve.from_file(file, step_s=1e-5).run(commands, 0.01).position_m
    composition = Composition.from_file(file)
    theta = composition.theta.copy()
    state = at_rest(composition, theta, 0.0, 0.0, 0.0)
    exponential = follow(composition, theta, state, commands, 0.01, 0.01, 1e-4)
    return float(np.abs(exponential.position_m - expected).max())


def test_a_stem_pressed_on_a_stop_comes_to_rest() -> None:
    stop = {"lower_m": 0.0, "travel_m": 0.03, "stiffness_n_per_m": 1e8, "damping_ns_per_m": 4e4}
    stopped = ValveFile(valve=SEED.valve, effect=(EffectTable.model_validate({"name": "end_stop", **stop}),))
    valve = Valve.from_file(stopped)
    valve.advance(60e3, 0.5)

    def external_n() -> float:
        contact_n = 1e8 * (valve.position_m - 0.03)
        return (
            SEED.valve.diaphragm_area_m2 * valve.pressure_pa - SEED.valve.spring_n_per_m * valve.position_m - contact_n
        )

    # Pressed a little harder than static friction bears, it creeps without ever leaving the band.
    harder_pa = (SEED.valve.static_n + 3.0 - external_n()) / SEED.valve.diaphragm_area_m2
    valve.advance(60e3 + harder_pa, 0.5)
    assert external_n() == pytest.approx(SEED.valve.static_n, abs=1e-5)
    assert valve.velocity_m_per_s == 0.0
    at_rest_m = valve.position_m
    valve.advance(60e3 + harder_pa, 0.5)
    assert valve.position_m == at_rest_m


def test_a_stuck_stem_does_not_move_at_all() -> None:
    valve = Valve.from_file(SEED)
    below = 0.999 * SEED.valve.static_n / SEED.valve.diaphragm_area_m2
    response = valve.run(np.linspace(0.0, below, 500), 1e-3)
    assert not response.position_m.any()
    valve.advance(1.002 * below, 0.05)
    assert valve.position_m > 1e-3


def test_it_comes_to_rest_where_friction_holds_the_spring() -> None:
    valve = Valve.from_file(SEED)
    valve.advance(60e3, 1.0)
    F_e = SEED.valve.diaphragm_area_m2 * 60e3 - SEED.valve.spring_n_per_m * valve.position_m
    assert valve.velocity_m_per_s == 0.0
    assert SEED.valve.coulomb_n < F_e < SEED.valve.static_n


def test_under_held_pressure_energy_only_falls() -> None:
    valve = Valve.from_file(changed(coulomb_n=100.0, static_n=150.0, viscous_ns_per_m=20.0))
    response = valve.run(np.full(5000, 50e3), 1e-4)
    energy = (
        0.5 * SEED.valve.mass_kg * response.velocity_m_per_s**2
        + 0.5 * SEED.valve.spring_n_per_m * response.position_m**2
        - SEED.valve.diaphragm_area_m2 * 50e3 * response.position_m
    )
    assert (response.velocity_m_per_s < -0.01).any(), "it should swing back"
    # Inside the band static friction pushes against F_e, not against v: dz F_s for the time of a reversal.
    assert np.diff(energy).max() < 1e-4
    assert response.velocity_m_per_s[-1] == 0.0


def test_without_stribeck_drop_it_creeps_along_the_band_and_goes_on() -> None:
    # F_v dz > 0 = F_s - F_c: just above F_s neither law lets the stem leave the band.
    file = changed(static_n=SEED.valve.coulomb_n)
    valve = Valve.from_file(file)
    valve.advance((SEED.valve.coulomb_n + 0.05) / SEED.valve.diaphragm_area_m2, 0.1)
    travel_m = 0.05 / SEED.valve.spring_n_per_m
    band_m_per_s = file.valve.deadzone_ratio * file.valve.stribeck_velocity_m_per_s
    assert travel_m <= valve.position_m < travel_m + band_m_per_s * 1e-5
    assert valve.velocity_m_per_s == 0.0

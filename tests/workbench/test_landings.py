"""Landings: the balance of forces where slides end gives the parameters that stand in it, without a simulation."""

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import ValveFile
from sim.composition import BASE, COULOMB, SPRING, STATIC, VISCOUS, Composition
from tests.workbench.valves import NOISE_M, SEED, drawn_valve, record_of, with_effect
from workbench.data.record import ready
from workbench.fit.break_aways import by_break_aways, making_up
from workbench.fit.landings import Landings, rests
from workbench.fit.objective import SimulationError
from workbench.model.free_run import FreeRun
from workbench.model.parameters import DEFAULT, free_parameters

DRAWN = drawn_valve(np.random.default_rng(0))
VALVE = ValveFile(valve=DRAWN.valve.model_copy(update={"viscous_ns_per_m": 2000.0}))
"""Damped well: a slide creeps into its landing and does not overshoot."""
PERIOD_S = 0.01


def slow_moves(count: int = 4000) -> Column:
    """Ramps of half a second between levels held for another, Pa: (count,). Nothing overshoots."""
    seed = SEED.valve
    span_pa = seed.spring_n_per_m * seed.stroke_m / seed.diaphragm_area_m2
    levels = span_pa * np.random.default_rng(3).uniform(0.15, 0.9, count // 100)
    return np.interp(np.arange(count), 50 * np.arange(2 * levels.size), np.repeat(levels, 2))


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("preload", {"force_n": 250.0}),
        ("flow_force", {"force_n": -300.0, "travel_m": 0.1}),
        ("asymmetric_friction", {"asymmetry": 0.2}),
        ("position_friction", {"growth": 0.5, "travel_m": 0.1}),
        ("spring_hardening", {"cubic_n_per_m3": 5e5}),
        ("friction_drift", {"rate_per_s": -0.005}),
    ],
)
def test_the_landings_alone_give_spring_friction_and_a_static_effect(name: str, values: dict[str, float]) -> None:
    truth = with_effect(VALVE, name, **values)
    record = ready(record_of(truth, 1, command_pa=slow_moves()))
    known = with_effect(SEED, name, **(values | dict.fromkeys(list(values)[:1], 0.0)))
    composition = Composition.from_file(known)
    fitted = f"{name}.{next(iter(values))}"
    parameters = free_parameters(composition, [*DEFAULT, fitted])
    error = SimulationError(FreeRun(composition, record), composition, parameters, composition.theta)
    solved = Landings(error, rests(record)).solved(composition.theta)
    assert solved is not None
    valve = VALVE.valve
    assert solved.left < 1.5, "standard deviations of a landing"
    assert solved.theta[SPRING] == pytest.approx(valve.spring_n_per_m, rel=2e-3)
    assert solved.theta[COULOMB] == pytest.approx(valve.coulomb_n, rel=0.01)
    assert solved.theta[STATIC] == pytest.approx(valve.static_n, rel=0.1), "between two stairs of the command"
    assert solved.theta[VISCOUS] == pytest.approx(composition.theta[VISCOUS]), "does not stand in a landing"
    index = composition.names.index(fitted)
    assert solved.theta[index] == pytest.approx(next(iter(values.values())), rel=0.05)


def test_break_aways_tell_static_friction_that_grows_with_the_rest() -> None:
    """It stands in no landing: half as strong, three times as slow, it broke loose at other rests than the stem."""
    growth_n, time_constant_s = 200.0, 0.4
    truth = with_effect(VALVE, "dwell_stiction", growth_n=growth_n, time_constant_s=time_constant_s)
    record = ready(record_of(truth, 1, 6000))
    known = with_effect(VALVE, "dwell_stiction", growth_n=0.5 * growth_n, time_constant_s=3.0 * time_constant_s)
    composition = Composition.from_file(known)
    parameters = free_parameters(composition, [*DEFAULT, "dwell_stiction.growth_n", "dwell_stiction.time_constant_s"])
    error = SimulationError(FreeRun(composition, record), composition, parameters, composition.theta)
    begin = error.coordinates(composition.theta)
    theta = error.theta(by_break_aways(error, begin))

    def off_n(theta: Column) -> float:
        dwell_s = np.geomspace(0.1, 2.0, 9)
        strength_n, slowness_s = theta[-2:]
        static_n = theta[STATIC] + strength_n * (1.0 - np.exp(-dwell_s / slowness_s))
        true_n = VALVE.valve.static_n + growth_n * (1.0 - np.exp(-dwell_s / time_constant_s))
        return float(np.abs(static_n - true_n).max())

    assert off_n(theta) < 0.7 * off_n(composition.theta)


def test_without_such_an_effect_break_aways_move_nothing() -> None:
    composition = Composition.from_file(with_effect(VALVE, "preload", force_n=100.0))
    record = ready(record_of(VALVE, 1, 3000))
    parameters = free_parameters(composition, [*DEFAULT, "preload.force_n"])
    error = SimulationError(FreeRun(composition, record), composition, parameters, composition.theta)
    begin = error.coordinates(composition.theta)
    assert by_break_aways(error, begin) is begin


def true_error(name: str, **values: float) -> tuple[SimulationError, Column]:
    """Return the error of the true valve with one effect, and its coordinates."""
    truth = with_effect(VALVE, name, **values)
    composition = Composition.from_file(truth)
    parameters = free_parameters(composition, [*DEFAULT, f"{name}.{next(iter(values))}"])
    record = ready(record_of(truth, 1, 3000))
    error = SimulationError(FreeRun(composition, record), composition, parameters, composition.theta)
    return error, error.coordinates(composition.theta)


def test_a_stribeck_excess_is_stronger_or_weaker_where_static_friction_makes_up_for_it() -> None:
    error, z = true_error("stribeck", excess_n=100.0, velocity_m_per_s=0.02, exponent=2.0)
    places = [error.theta(each) for each in making_up(error, z)]
    broken_at_n = error.theta(z)[STATIC] + 100.0
    assert {np.sign(each[len(BASE)] - 100.0) for each in places} == {-1.0, 1.0}
    assert [each[STATIC] + each[len(BASE)] for each in places] == pytest.approx([broken_at_n] * len(places), rel=1e-6)
    elsewhere = z.copy()
    elsewhere[-1] *= 0.6
    *_, last = making_up(error, z, [elsewhere])
    assert last[-1] == elsewhere[-1], "what is elsewhere stays there, and static friction makes up for it"
    assert error.theta(last)[STATIC] + error.theta(last)[len(BASE)] == pytest.approx(broken_at_n, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "values"), [("preload", {"force_n": 100.0}), ("asymmetric_friction", {"asymmetry": 0.2})]
)
def test_what_break_aways_tell_from_static_friction_does_not_make_up_for_it(
    name: str, values: dict[str, float]
) -> None:
    error, z = true_error(name, **values)
    assert not making_up(error, z)


def test_a_rest_knows_where_its_slide_came_from_and_where_the_next_one_goes() -> None:
    generator = np.random.default_rng(0)
    levels_m = np.array([0.02, 0.05, 0.04, 0.041, 0.08])
    position_m = np.repeat(levels_m, 40) + NOISE_M * generator.standard_normal(200)
    time_s = PERIOD_S * np.arange(200, dtype=np.float64)
    columns = {"time_s": time_s, "command_pa": np.linspace(0.0, 1e5, 200), "position_m": position_m}
    found = rests(ready(Recording(columns)))
    assert [round(each.position_m, 4) for each in found] == levels_m.tolist()
    assert [each.direction for each in found] == [0, 1, -1, 1, 1]
    assert [each.leaves_to for each in found] == [1, -1, 1, 1, 0]
    assert all(each.end - each.first > 35 for each in found)


def test_a_slow_slide_is_no_rest() -> None:
    t = PERIOD_S * np.arange(400, dtype=np.float64)
    position_m = 0.05 + 8e-3 * t + NOISE_M * np.random.default_rng(0).standard_normal(400)
    assert not rests(ready(Recording({"time_s": t, "command_pa": 1e5 + t, "position_m": position_m})))


def test_too_few_landings_say_nothing() -> None:
    record = ready(record_of(VALVE, 1, command_pa=slow_moves(300)))
    composition = Composition.from_file(SEED)
    parameters = free_parameters(composition, BASE[2:4])
    error = SimulationError(FreeRun(composition, record), composition, parameters, composition.theta)
    assert Landings(error, rests(record)[:3]).solved(composition.theta) is None


def test_what_acts_in_time_is_no_matter_of_rests() -> None:
    """A sensor that lags has caught up where the stem rests; however far off spring and friction are, its lag stays."""
    truth = with_effect(VALVE, "sensor_lag", time_constant_s=0.06)
    record = ready(record_of(truth, 1, command_pa=slow_moves()))
    composition = Composition.from_file(with_effect(SEED, "sensor_lag", time_constant_s=0.03))
    fitted = "sensor_lag.time_constant_s"
    parameters = free_parameters(composition, [*DEFAULT, fitted])
    error = SimulationError(FreeRun(composition, record), composition, parameters, composition.theta)
    solved = Landings(error, rests(record)).solved(composition.theta)
    assert solved is not None
    assert solved.theta[composition.names.index(fitted)] == pytest.approx(0.03)
    assert solved.theta[SPRING] == pytest.approx(VALVE.valve.spring_n_per_m, rel=2e-3)

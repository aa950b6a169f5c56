"""The balance of forces where a slide ends: compiled as the text says, and where a run comes to rest."""

import numpy as np
import pytest

from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim.composition import AREA, COULOMB, SPRING, STATIC, STRIBECK, Composition
from sim.interpreted import interpreted
from sim.open_loop import respond

SEED = load_valve(shipped_valve("seed"))
EFFECTS = (
    {"name": "preload", "force_n": 200.0},
    {"name": "asymmetric_friction", "asymmetry": 0.1},
    {"name": "dwell_stiction", "growth_n": 100.0, "time_constant_s": 2.0},
    {"name": "backlash", "width_m": 1e-3},
    {"name": "sensor_nonlinearity", "bow_m": 2e-3, "travel_m": 0.1},
)
LANDINGS = np.array(
    [
        # landed, asked, shown, before the slide, pressure, way of the slide, way asked
        [1.0, 1.0, 0.03, 0.01, 40e3, 1.0, 1.0],
        [2.0, 4.0, 0.02, 0.03, 18e3, -1.0, -1.0],
        [5.0, 9.0, 0.06, 0.02, 61e3, 1.0, -1.0],
    ]
)


def composed(*effects: dict[str, object]) -> Composition:
    return Composition.from_file(
        ValveFile(valve=SEED.valve, effect=tuple(EffectTable.model_validate(each) for each in effects))
    )


@pytest.mark.parametrize("effects", [(), *((each,) for each in EFFECTS), EFFECTS])
@pytest.mark.parametrize("slow", [False, True])
def test_it_is_compiled_as_the_laws_say(effects: tuple[dict[str, object], ...], slow: bool) -> None:
    composition = composed(*effects)
    if slow:
        assert composition.quasi_static, "that kernel has it, too"
    laws = interpreted(composition.effects)
    theta, speed = composition.theta, 3.0 * float(composition.theta[STRIBECK])
    expected = np.empty((len(LANDINGS), 3))
    laws.balance(theta, np.zeros(composition.state_size), LANDINGS, speed, speed, expected)
    assert composition.balance_n(theta, LANDINGS, speed, speed) == pytest.approx(expected, rel=1e-12, abs=1e-9)


def test_a_slide_that_a_run_makes_ends_where_the_forces_balance() -> None:
    composition = composed({"name": "preload", "force_n": 200.0}, {"name": "sensor_offset", "offset_m": 2e-3})
    theta = composition.theta
    overdamped = composition.changed(theta, {"viscous_ns_per_m": 20_000.0})
    begin_pa = 1.001 * (theta[STATIC] + 200.0) / theta[AREA]
    answer = respond(composition, overdamped, np.linspace(begin_pa, begin_pa + 3e4, 4000), 5e-3)
    shown_m = float(answer.indicated_m[-1])
    landing = np.array([[20.0, 20.0, shown_m, 2e-3, float(answer.pressure_pa[-1]), 1.0, 1.0]])
    ((force_n, coulomb_n, _),) = composition.balance_n(theta, landing, 0.0, 0.0)
    speed_m_per_s = 3e4 / 20.0 * theta[AREA] / theta[SPRING]
    assert coulomb_n == theta[COULOMB]
    assert force_n == pytest.approx(coulomb_n + 20_000.0 * speed_m_per_s, rel=0.02), "it creeps on as the pressure does"


def test_no_landings_have_no_forces() -> None:
    assert composed().balance_n(composed().theta, np.empty((0, 7)), 0.0, 0.0).shape == (0, 3)

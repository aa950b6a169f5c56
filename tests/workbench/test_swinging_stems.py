"""A stem with little damping swings past its balance and sticks there: that shows at one sample a second, too."""

import numpy as np
import pytest

from config.recording import Recording
from config.valve_file import ValveFile
from sim.composition import Composition
from sim.effect import FINE_STEP_S
from sim.open_loop import respond
from tests.workbench.valves import NOISE_M, SEED
from workbench.compare.comparison import compare
from workbench.data.record import ready
from workbench.fit.fitting import fit
from workbench.model.simulation_regime import Motion, sampling, swing_m

SWINGING = ValveFile(
    valve=SEED.valve.model_copy(
        update={"viscous_ns_per_m": 0.5 * SEED.valve.viscous_ns_per_m, "coulomb_n": 700.0, "static_n": 850.0}
    )
)
FINE = 20
"""Steps of the simulation between two samples."""


def staircase(valve: ValveFile, seed: int = 4, count: int = 300) -> Recording:
    generator = np.random.default_rng(seed)
    span_pa = SEED.valve.spring_n_per_m * SEED.valve.stroke_m / SEED.valve.diaphragm_area_m2
    command_pa, k = np.empty(count), 0
    while k < count:
        holds = int(generator.integers(6, 20))
        command_pa[k : k + holds] = span_pa * generator.uniform(0.05, 0.95)
        k += holds
    composition = Composition.from_file(valve)
    finely = np.repeat(command_pa[:-1], FINE)
    begin = {"position_m": 0.5 * SEED.valve.stroke_m, "pressure_pa": 0.5 * span_pa}
    answer = respond(composition, composition.theta, finely, 1.0 / FINE, step_s=FINE_STEP_S, **begin)
    position_m = answer.indicated_m[::FINE] + NOISE_M * generator.standard_normal(count)
    return Recording({"time_s": np.arange(float(count)), "command_pa": command_pa, "position_m": position_m})


def test_a_stem_that_swings_is_simulated_with_inertia_however_slowly_it_is_seen() -> None:
    record = ready(staircase(SWINGING))
    assert sampling(record, SEED.valve).motion is Motion.QUASI_STATIC
    assert swing_m(SEED.valve) < 1e-6
    assert swing_m(SWINGING.valve) > 1e-3
    assert sampling(record, SWINGING.valve).motion is Motion.DYNAMIC
    assert compare(staircase(SWINGING), SWINGING).rms_m < 1.15 * NOISE_M, "3 mm without inertia"


def test_what_the_file_does_not_know_of_its_damping_the_fit_finds() -> None:
    found = fit(staircase(SWINGING), SEED)
    assert found.by.motion is Motion.DYNAMIC
    assert found.rms_m < 1.15 * NOISE_M, "0.3 mm and more without inertia"
    assert found.parameters["viscous_ns_per_m"].value == pytest.approx(SWINGING.valve.viscous_ns_per_m, rel=0.02)


def test_what_is_at_the_floor_without_inertia_stays_so() -> None:
    assert fit(staircase(SEED), SEED).by.motion is Motion.QUASI_STATIC

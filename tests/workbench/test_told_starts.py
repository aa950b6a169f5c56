"""Searches at one sample a second, landings told and then static friction: the true effect's own reaches the floor.

A random staircase, of which most slips are wide: an asymmetry that is off by a third makes as many of them as the true
one does while static friction is off.
"""

import numpy as np
import pytest

from config.recording import Recording
from config.valve_file import EffectTable, ValveFile, ValveParameters
from sim.composition import Composition
from sim.open_loop import respond
from workbench.fit.fitting import fit

NOISE_M, FINE = 3e-5, 50
"""Noise of the sensor; steps of the simulation between two samples."""
ASYMMETRY = -0.25


def valve(spring_n_per_m: float, coulomb_n: float, static_n: float, viscous_ns_per_m: float) -> ValveParameters:
    return ValveParameters(
        name="FV",
        mass_kg=6.0,
        diaphragm_area_m2=0.045,
        spring_n_per_m=spring_n_per_m,
        viscous_ns_per_m=viscous_ns_per_m,
        coulomb_n=coulomb_n,
        static_n=static_n,
        stribeck_velocity_m_per_s=1e-3,
        deadzone_ratio=0.5,
        stroke_m=0.04,
    )


KNOWN = ValveFile(valve=valve(90e3, 200.0, 300.0, 1400.0))
TRUE = ValveFile(
    valve=valve(95e3, 260.0, 340.0, 1700.0),
    effect=(EffectTable.model_validate({"name": "asymmetric_friction", "asymmetry": ASYMMETRY}),),
)


def staircase(seed: int, count: int = 500) -> Recording:
    generator = np.random.default_rng(seed)
    command_pa, k = np.empty(count), 0
    while k < count:
        holds = int(generator.integers(6, 20))
        command_pa[k : k + holds] = generator.uniform(10e3, 75e3)
        k += holds
    composition = Composition.from_file(TRUE)
    finely = np.repeat(command_pa[:-1], FINE)
    answer = respond(composition, composition.theta, finely, 1.0 / FINE, position_m=0.02, pressure_pa=42e3)
    position_m = answer.indicated_m[::FINE] + NOISE_M * generator.standard_normal(count)
    return Recording({"time_s": np.arange(float(count)), "command_pa": command_pa, "position_m": position_m})


@pytest.mark.parametrize("seed", [23, 51, 53])
def test_the_true_effects_search_reaches_the_floor(seed: int) -> None:
    found = fit(staircase(seed), KNOWN, effects=("asymmetric_friction",), profile=False)
    assert found.by.slow
    assert found.rms_m < 1.15 * NOISE_M, "0.07 mm, and an asymmetry of -0.12 to -0.17, by the screening cost alone"
    assert found.parameters["asymmetric_friction.asymmetry"].value == pytest.approx(ASYMMETRY, abs=0.02)

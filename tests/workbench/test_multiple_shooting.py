"""Multiple shooting: each slip answers for itself, and a valley is there where the free run has stairs."""

from itertools import chain

import numpy as np
import pytest

from config.valve_file import ValveFile
from sim.composition import Composition
from sim.karnopp import BASE_PARAMETERS
from tests.workbench.valves import NOISE_M, SLIM, creeping, record_of, with_effect
from workbench.blind.hiding import hide
from workbench.data.record import Record, ready
from workbench.fit.descent import descended_through
from workbench.fit.fitting import fit
from workbench.fit.objective import MIDDLE, SimulationError
from workbench.fit.shooting import shooting_starts
from workbench.fit.starts import effect_starts
from workbench.model.free_run import FreeRun
from workbench.model.multiple_shooting import MultipleShooting, slips_from_rest
from workbench.model.parameters import DEFAULT, free_parameters

OVER = ("velocity_m_per_s", "exponent")
VALVE = with_effect(SLIM, "stribeck", excess_n=60.0, velocity_m_per_s=0.012, exponent=2.0)


@pytest.fixture(scope="module")
def record() -> Record:
    return ready(record_of(VALVE, 4, command_pa=creeping()))


def off(file: ValveFile, record: Record, run: type[FreeRun]) -> float:
    """Return the rms error of a run, in noises."""
    composition = Composition.from_file(file)
    return float(np.std(run(composition, record).position_m(composition.theta) - record.position_m) / NOISE_M)


def test_what_one_slip_is_wrong_by_the_next_ones_do_not_know(record: Record) -> None:
    wrong = ValveFile(
        valve=VALVE.valve.model_copy(update={"coulomb_n": 0.99 * VALVE.valve.coulomb_n}), effect=VALVE.effect
    )
    assert off(VALVE, record, FreeRun) < 1.1
    assert off(VALVE, record, MultipleShooting) < 1.2, "put back to a mean of noisy samples"
    assert off(wrong, record, FreeRun) > 3.0 * off(wrong, record, MultipleShooting)


def test_halves_are_judged_apart(record: Record) -> None:
    composition = Composition.from_file(VALVE)
    even, odd = (MultipleShooting(composition, record, part=part) for part in (0, 1))
    assert slips_from_rest(record) > 20
    assert not (even.judged & odd.judged).any()
    assert (even.judged | odd.judged).all()
    assert 0.3 < even.judged.mean() < 0.7


def test_pressure_and_its_memory_go_on(record: Record) -> None:
    lagged = ValveFile(valve=VALVE.valve, effect=with_effect(VALVE, "ip_lag", time_constant_s=0.2).effect)
    composition = Composition.from_file(lagged)
    runs = [each(composition, record).run(composition.theta) for each in (FreeRun, MultipleShooting)]
    assert np.array_equal(runs[0].pressure_pa, runs[1].pressure_pa)
    assert not np.array_equal(runs[0].stem_m, runs[1].stem_m)


@pytest.mark.long
def test_it_leads_where_the_free_run_shows_no_way() -> None:
    """Friction's fall with speed, which a fit of the bare valve takes for static friction: 93 slips, most in ramps."""
    hidden = hide(52017)
    record, base = ready(hidden.fit), fit(hidden.fit, hidden.base, workers=1, profile=False)
    composition = Composition.from_file(ValveFile(valve=base.valve.valve, effect=hidden.truth.effect))
    parameters = free_parameters(composition, [*DEFAULT, *(f"stribeck.{each}" for each in ("excess_n", *OVER))])
    error = SimulationError(FreeRun(composition, record), composition, parameters, composition.theta)
    off = np.array([0.0, *composition.theta[BASE_PARAMETERS + 1 :]])
    seed = np.concatenate([base.seeds[0], off])
    starts = effect_starts(error, parameters[len(DEFAULT) :], [seed, seed, seed], landed=False)
    found = shooting_starts(error, starts.strengths, error.coordinates(seed))
    assert {each.origin for each in found} == {"slips", "even slips", "odd slips"}
    true_cost = error.cost(error.coordinates(Composition.from_file(hidden.truth).theta))
    assert min(error.cost(each.z) for each in found) < 1.2 * true_cost
    free = error.rough.least(chain.from_iterable(starts.strengths), MIDDLE)
    assert error.cost(descended_through(error, free)) > 3.0 * true_cost


def test_nothing_is_begun_where_nothing_is_left(record: Record) -> None:
    composition = Composition.from_file(VALVE)
    parameters = free_parameters(composition, DEFAULT)
    error = SimulationError(FreeRun(composition, record), composition, parameters, composition.theta)
    there = error.coordinates(composition.theta)
    assert not shooting_starts(error, [[there + 0.02]], there)


@pytest.mark.long
def test_a_lag_that_the_base_fit_took_for_viscous_friction_is_found() -> None:
    """Ten times the friction: of the strengths the least error is at the weakest, and leads to 240 times the noise."""
    hidden = hide(41039)
    base = fit(hidden.fit, hidden.base, workers=1, profile=False)
    assert base.parameters["viscous_ns_per_m"].value > 5.0 * hidden.truth.valve.viscous_ns_per_m
    found = fit(hidden.fit, hidden.base, effects=["sensor_lag"], base=base, workers=1, profile=False)
    (lag,) = hidden.truth.effect
    assert found.parameters["sensor_lag.time_constant_s"].value == pytest.approx(
        lag.parameters["time_constant_s"], rel=0.01
    )
    assert found.trusted

"""The cost of a run that is given up early: the same where it is below the limit, else infinite."""

from math import inf

import numpy as np
import pytest

from config.recording import Recording
from sim.composition import Composition
from sim.misfit import Judge
from tests.workbench.valves import SEED, drawn_valve, record_of, with_effect
from workbench.data.record import ready
from workbench.fit.objective import FINAL, SimulationError, soft
from workbench.model.free_run import FreeRun
from workbench.model.parameters import free_parameters


@pytest.fixture(scope="module")
def error() -> SimulationError:
    """A record with a gap and a missing sample, and a valve with a memory: what stretches could get wrong."""
    valve = with_effect(drawn_valve(np.random.default_rng(11)), "ip_lag", time_constant_s=0.05)
    whole = record_of(valve, 5, 900)
    columns = {name: np.delete(column, slice(400, 430)) for name, column in whole.columns.items()}
    columns["position_m"] = columns["position_m"].copy()
    columns["position_m"][100] = np.nan
    composition = Composition.from_file(valve)
    run = FreeRun(composition, ready(Recording(columns, whole.metadata)))
    assert len(run.record.segments) == 2
    return SimulationError(run, composition, free_parameters(composition, ["coulomb_n"]), composition.theta)


def test_below_the_limit_it_is_the_cost(error: SimulationError) -> None:
    z = error.coordinates(error.composition.theta) + 0.01
    fresh = SimulationError(error.run, error.composition, error.parameters, error.composition.theta)
    assert fresh.cost_below(z, inf) == pytest.approx(error.cost(z), rel=1e-12)
    assert fresh.cost_below(z, error.cost(z)) == inf
    assert SimulationError.cost_below(error, z, 0.5 * error.cost(z)) == inf


def test_a_run_far_above_the_limit_is_given_up(error: SimulationError) -> None:
    z = error.coordinates(error.composition.theta) + 0.02
    whole = np.full(len(error.run.record), np.nan)
    whole[error.rows] = error.residuals(z)
    judge = Judge(error.sigma_m, 0.0, 1.0, FINAL, 0.05 * error.cost(z))
    errors, cost = error.run.misfit(error.theta(z), error.run.record.position_m, judge)
    assert judge.limit <= cost < 0.5 * error.cost(z)
    known = np.flatnonzero(np.cumsum(np.nan_to_num(whole) ** 2) < judge.limit)
    np.testing.assert_array_equal(errors[known], whole[known])


@pytest.mark.parametrize("by_slips", [False, True])
def test_it_is_what_a_run_shows_less_what_was_measured(error: SimulationError, by_slips: bool) -> None:
    held = error.by_slips() if by_slips else error
    z = held.coordinates(held.composition.theta) + 0.01
    record = held.run.record
    apart_m = (held.run.position_m(held.theta(z)) - record.position_m)[record.valid]
    assert held.residuals(z) == pytest.approx(apart_m / held.sigma_m, rel=1e-12)
    assert held.cost(z) == pytest.approx(soft(held.residuals(z), FINAL), rel=1e-12)


def test_without_inertia_it_is_the_same() -> None:
    valve = SEED
    quick = record_of(valve, 5, 900)
    record = ready(Recording(dict(quick.columns) | {"time_s": 100.0 * quick.time_s}))
    composition = Composition.from_file(valve)
    run = FreeRun(composition, record)
    assert run.by.slow
    slow = SimulationError(run, composition, free_parameters(composition, ["coulomb_n"]), composition.theta)
    z = slow.coordinates(composition.theta) + 0.01
    apart_m = (run.position_m(slow.theta(z)) - record.position_m)[run.judged & record.valid]
    assert slow.residuals(z) == pytest.approx(apart_m / slow.sigma_m, rel=1e-12)
    assert slow.cost(z) == pytest.approx(soft(slow.residuals(z), FINAL), rel=1e-12)
    fresh = SimulationError(run, composition, slow.parameters, composition.theta)
    assert fresh.cost_below(z, 0.5 * slow.cost(z)) == inf

"""The cost of a run that is given up early: the same where it is below the limit, else infinite."""

from math import inf

import numpy as np
import pytest

from config.recording import Recording
from sim.composition import Composition
from tests.workbench.valves import drawn_valve, record_of, with_effect
from workbench.data.record import ready
from workbench.fit.objective import FINAL, SimulationError
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


def test_a_run_far_above_the_limit_is_given_up(error: SimulationError, monkeypatch: pytest.MonkeyPatch) -> None:
    z = error.coordinates(error.composition.theta) + 0.02
    fresh = SimulationError(error.run, error.composition, error.parameters, error.composition.theta)
    stretches = list(error.run.stretches(error.theta(z)))
    seen: list[int] = []

    def told(_: object, theta: object) -> object:
        for number, stretch in enumerate(stretches):
            seen.append(number)
            yield stretch

    monkeypatch.setattr(FreeRun, "stretches", told)
    assert fresh.cost_below(z, 0.05 * error.cost(z, FINAL)) == inf
    assert len(seen) < len(stretches)


def test_stretch_by_stretch_a_run_is_the_same(error: SimulationError) -> None:
    whole = error.run.position_m(error.composition.theta)
    for rows, position_m in error.run.stretches(error.composition.theta):
        assert np.array_equal(whole[rows], position_m)

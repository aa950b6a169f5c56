"""Static friction of a valve whose break-aways scatter: their mean is told, however early a run breaks loose."""

import numpy as np
import pytest

from config.recording import Recording
from sim.composition import COULOMB, SPRING, STATIC, Composition
from sim.karnopp import Vector
from workbench.blind.hiding import hide
from workbench.data.record import ready
from workbench.fit.objective import SimulationError
from workbench.fit.static_scatter import static_within
from workbench.fit.uncertainty import uncertainty
from workbench.model.free_run import FreeRun
from workbench.model.parameters import AT_REST, LANDED, free_parameters

SEEDS = range(262000, 262024, 2)
"""Nothing is hidden; break-aways are drawn anew at every stop, 4 %, under pressure noise."""


def posed(seed: int, free: tuple[str, ...] = AT_REST, samples: int | None = None) -> tuple[SimulationError, Vector]:
    """Return the error of a hidden valve's own record, and the true coordinates."""
    hidden = hide(seed, effects=0, dirty=True)
    composition = Composition.from_file(hidden.truth)
    columns = {name: each[:samples] for name, each in hidden.fit.columns.items()}
    record = ready(Recording(columns, hidden.fit.metadata))
    error = SimulationError(
        FreeRun(composition, record), composition, free_parameters(composition, free), composition.theta
    )
    return error, error.coordinates(composition.theta)


def test_the_mean_of_break_aways_is_told() -> None:
    held = 0
    for seed in SEEDS:
        error, z = posed(seed)
        lower_n, upper_n = (float(error.theta(each)[STATIC]) for each in static_within(error, z))
        true_n = float(error.theta(z)[STATIC])
        assert 0.0 < upper_n - lower_n < 0.15 * true_n
        held += lower_n <= true_n <= upper_n
    assert held >= len(SEEDS) - 2


def test_an_interval_takes_it_in_where_the_run_breaks_loose_too_early() -> None:
    error, z = posed(262008)
    early = error.theta(z)
    early[STATIC] = 1.1 * early[COULOMB]
    found = uncertainty(error, error.coordinates(early))
    assert found.lower[-1] <= z[-1] <= found.upper[-1], "by the run alone it ends below"


@pytest.mark.parametrize(("free", "samples"), [(LANDED, None), (AT_REST, 300)])
def test_without_static_friction_or_with_few_break_aways_nothing_is_told(
    free: tuple[str, ...], samples: int | None
) -> None:
    assert static_within(*posed(SEEDS[0], free, samples)) == []


def test_a_valve_far_from_the_record_is_asked_without_a_warning() -> None:
    """Its break-aways ask for a static friction below nothing: a diagnosis comes by such valves."""
    error, z = posed(SEEDS[0])
    far = error.theta(z)
    far[SPRING] *= 0.02
    assert all(np.isfinite(each).all() for each in static_within(error, error.coordinates(far)))

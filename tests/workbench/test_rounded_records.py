"""A fit of a record that is rounded: right, or not trusted."""

import numpy as np
import pytest

from benchmarks.searches import Case, posed, true_cost
from config.recording import Recording
from tests.cases import few_always
from tests.workbench.slow_records import once_a_second
from tests.workbench.valves import SEED
from workbench.blind.hiding import hide
from workbench.data.noise_floor import with_noise
from workbench.data.record import ready
from workbench.fit.fitting import at_the_noise, fit
from workbench.select.effect_acceptance import evidence_for

WITHIN = 1.01
"""Factor on the cost of the true parameters, within which a fit has come to them."""


@pytest.mark.long
@pytest.mark.parametrize("seed", [52027, 52055])
def test_where_a_sensor_rounds_a_trusted_fit_is_the_truth(seed: int) -> None:
    hidden = hide(seed)
    assert [each.name for each in hidden.truth.effect] == ["quantisation"]
    base = fit(hidden.fit, hidden.base, workers=1)
    found = fit(hidden.fit, hidden.base, effects=("quantisation",), workers=1, base=base)
    least = true_cost(hidden.fit, hidden.truth)
    assert found.cost < WITHIN * least or not found.trusted
    assert found.cost < 1.1 * least


@pytest.mark.long
def test_a_quantum_finer_than_the_noise_that_is_stated_is_not_proved_however_many_searches_agree() -> None:
    hidden = hide(52055)
    columns = {name: each[:652] for name, each in hidden.fit.columns.items()}
    recording = with_noise(Recording(columns, hidden.fit.metadata), 1.7e-4)
    base = fit(recording, hidden.base, workers=1)
    found = fit(recording, hidden.base, effects=("quantisation",), workers=1, base=base)
    assert found.parameters["quantisation.quantum_m"].value < ready(recording).scale_m
    assert found.cost < base.cost / WITHIN, "though it does better than the base"
    assert evidence_for(found, base) < 0.0


@pytest.mark.parametrize(("digits", "told"), [(8, False), (5, True)])
def test_the_digits_of_a_file_are_no_rounding(digits: int, told: bool) -> None:
    """Of a day with ten digits it said "rounded to 5e-12 m", where nothing finer than 0.3 um is judged."""
    recording = once_a_second(SEED)
    position_m = np.round(recording.columns["position_m"], digits)
    notes = ready(Recording({**recording.columns, "position_m": position_m}, recording.metadata)).notes
    assert any("is rounded to" in each for each in notes) == told


@pytest.mark.parametrize("seed", few_always([180522, 180209, 160237]))
def test_few_rests_are_rounded_as_the_sensor_does(seed: int) -> None:
    recording, valve, truth = posed(Case("quantisation", seed, "poor"))
    base = fit(recording, valve, workers=1)
    found = fit(recording, valve, effects=("quantisation",), workers=1, base=base)
    assert at_the_noise(found.cost, found.count)
    assert found.parameters["spring_n_per_m"].value == pytest.approx(truth.valve.spring_n_per_m, rel=1e-3)
    known_m = dict(truth.effect[0])["quantum_m"]
    assert found.parameters["quantisation.quantum_m"].value == pytest.approx(known_m, rel=1e-3)

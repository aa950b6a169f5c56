"""Where searches begin: places that the record itself suggests, which no search from elsewhere would find."""

import numpy as np
import pytest

from config.recording import Recording
from sim.composition import COULOMB, STATIC, Composition
from tests.workbench.valves import NOISE_M, drawn_valve, record_of, with_effect
from workbench.fitting import fit
from workbench.hiding import hide
from workbench.parameters import free_parameters
from workbench.record import ready
from workbench.starts import quanta_seen_m, values_seen, with_plays

VALVE = drawn_valve(np.random.default_rng(0))
STOPS = {"lower_m": 0.012, "travel_m": 0.06, "stiffness_n_per_m": 1e8, "damping_ns_per_m": 1e4}


def recorded(**effect: float | str) -> Recording:
    name = str(effect.pop("name"))
    return record_of(with_effect(VALVE, name, **{key: float(value) for key, value in effect.items()}), 0)


@pytest.mark.parametrize("quantum_m", [2e-4, 5e-4])
def test_a_quantum_of_a_few_noises_is_among_the_likely_ones(quantum_m: float) -> None:
    likely_m = quanta_seen_m(ready(recorded(name="quantisation", quantum_m=quantum_m)))
    assert min(abs(each / quantum_m - 1.0) for each in likely_m) < 2e-3


def test_stops_are_sought_where_the_positions_end() -> None:
    composition = Composition.from_file(with_effect(VALVE, "end_stop", **STOPS))
    added = free_parameters(composition, ["end_stop.lower_m", "end_stop.travel_m"])
    seen = values_seen(added, ready(recorded(name="end_stop", **STOPS)))
    lowest, swept = np.array(seen).T
    upper = lowest + swept
    assert np.min(np.abs(upper - 0.072)) < 4.0 * NOISE_M
    assert np.any(upper > 0.075), "the upper stop alone out of reach"
    assert np.any(lowest < lowest.max() - 2e-3), "the lower stop alone out of reach"


def test_a_play_takes_from_friction_what_friction_stood_in_for() -> None:
    composition = Composition.from_file(with_effect(VALVE, "backlash", width_m=0.0))
    added = free_parameters(composition, ["backlash.width_m"])
    bands = with_plays(composition.theta, added)
    assert len(bands) == 3
    for theta in (each for band in bands for each in band):
        shift_n = 0.5 * VALVE.valve.spring_n_per_m * theta[-1]
        assert theta[COULOMB] == pytest.approx(VALVE.valve.coulomb_n - shift_n)
        assert abs(theta[STATIC] - VALVE.valve.static_n) <= 1.0001 * shift_n
        assert theta[COULOMB] > 0.0
    assert not with_plays(composition.theta, free_parameters(composition, ["spring_n_per_m"]))


def test_an_area_that_varies_is_found_though_spring_and_friction_must_move_far_with_it() -> None:
    hidden = hide(31013)
    assert [each.name for each in hidden.truth.effect] == ["area_variation"]
    found = fit(hidden.fit, hidden.base, effects=("area_variation",), profile=False)
    assert found.rms_m < 1.1 * NOISE_M
    truth = hidden.truth.effect[0].parameters["change_m2"]
    assert found.parameters["area_variation.change_m2"].value == pytest.approx(truth, rel=0.02)

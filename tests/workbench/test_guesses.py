"""Places that the record itself suggests for a search to begin, which no search from elsewhere would find."""

import numpy as np
import pytest

from config.recording import Column, Recording
from sim.composition import Composition
from tests.workbench.valves import NOISE_M, drawn_valve, pressures, record_of, with_effect
from workbench.data.record import ready
from workbench.fit.fitting import fit
from workbench.fit.guesses import guessed_values, likely_delays_s, likely_quanta_m
from workbench.model.search_coordinates import free_parameters

VALVE = drawn_valve(np.random.default_rng(0))
PER_M_PA = VALVE.valve.spring_n_per_m / VALVE.valve.diaphragm_area_m2
STOPS = {"lower_m": 0.012, "travel_m": 0.06, "stiffness_n_per_m": 1e8, "damping_ns_per_m": 1e4}


def recorded(**effect: float | str) -> Recording:
    name = str(effect.pop("name"))
    return record_of(with_effect(VALVE, name, **{key: float(value) for key, value in effect.items()}), 0)


@pytest.mark.parametrize("quantum_m", [1.4e-4, 2e-4, 5e-4])
def test_a_quantum_of_a_few_noises_is_among_the_likely_ones(quantum_m: float) -> None:
    likely_m = likely_quanta_m(ready(recorded(name="quantisation", quantum_m=quantum_m)))
    assert min(abs(each / quantum_m - 1.0) for each in likely_m) < 2e-3


def test_without_enough_rests_all_positions_show_the_quantum() -> None:
    quantum_m = 5e-4
    columns = recorded(name="quantisation", quantum_m=quantum_m).columns
    moving = Recording({name: each[:1500] for name, each in columns.items()})
    assert likely_quanta_m(ready(moving))[0] == pytest.approx(quantum_m, rel=2e-3)


def test_a_stem_that_hardly_moves_shows_no_quantum() -> None:
    columns = recorded(name="quantisation", quantum_m=5e-4).columns
    assert likely_quanta_m(ready(Recording({name: each[:300] for name, each in columns.items()}))) == []


def test_stops_are_sought_where_the_positions_end() -> None:
    composition = Composition.from_file(with_effect(VALVE, "end_stop", **STOPS))
    added = free_parameters(composition, ["end_stop.lower_m", "end_stop.travel_m"])
    guessed = guessed_values(added, ready(recorded(name="end_stop", **STOPS)))
    lowest, swept = np.array(guessed).T
    upper = lowest + swept
    assert np.min(np.abs(upper - 0.072)) < 4.0 * NOISE_M
    assert np.any(upper > 0.075), "the upper stop alone out of reach"
    assert np.any(lowest < lowest.max() - 2e-3), "the lower stop alone out of reach"


@pytest.mark.long
def test_a_stop_that_the_stem_nowhere_comes_to_may_be_anywhere_below() -> None:
    """Where the record happens to end a lower stop had been found, 95 %: 3.5 to 5.4 mm, and the law went no lower."""
    upper_m, lowest_m = 0.06, 0.02
    generator = np.random.default_rng(0)
    command_pa = np.maximum(pressures(generator, 1500), 1.2 * lowest_m * PER_M_PA)
    stops = {"lower_m": -0.3e-3, "travel_m": upper_m + 0.3e-3, "stiffness_n_per_m": 1e8, "damping_ns_per_m": 1e4}
    recording = record_of(with_effect(VALVE, "end_stop", **stops), 0, command_pa=command_pa)
    assert float(recording.columns["position_m"].min()) > lowest_m
    found = fit(recording, VALVE, effects=("end_stop",)).parameters
    lower, travel = found["end_stop.lower_m"], found["end_stop.travel_m"]
    assert lower.value < float(recording.columns["position_m"].min())
    assert lower.lower < -0.3e-3, "nothing excludes the truth, nor that there is none"
    assert lower.upper > lowest_m
    assert lower.value + travel.value == pytest.approx(upper_m, abs=2.0 * NOISE_M)


@pytest.mark.parametrize("late", [0, 1, 3])
def test_how_late_the_stem_is_shows_where_a_held_command_changes(late: int) -> None:
    generator = np.random.default_rng(5)
    steps = np.repeat(generator.uniform(0.02, 0.08, 30), 12)
    position_m = steps[np.maximum(np.arange(360) - late, 0)] + 1e-5 * generator.standard_normal(360)
    time_s: Column = 2.0 * np.arange(360.0, dtype=np.float64)
    record = ready(Recording({"time_s": time_s, "command_pa": 1e6 * steps, "position_m": position_m}))
    assert likely_delays_s(record) == ([2.0 * (late - 0.5)] if late else [])
    ramps: dict[str, Column] = {"time_s": time_s, "command_pa": np.linspace(0.0, 8e4, 360), "position_m": position_m}
    assert likely_delays_s(ready(Recording(ramps))) == []

"""A mass that was assumed too large is found out where it shows, and left alone where it does not."""

import numpy as np
import pytest

from tests.workbench.hand_made import AT_FLOOR, FLOOR_M, model_of
from tests.workbench.valves import drawn_valve, record_of
from workbench.blind.input_signal import excitation
from workbench.diagnosis.diagnosis import diagnose
from workbench.diagnosis.kept_mass import KeptMass, explains_most, leaves_something

LIGHT_KG = 1.4


@pytest.mark.parametrize(("floors", "left"), [(1.0, False), (1.15, False), (1.4, True), (4.0, True)])
def test_it_is_asked_wherever_more_is_left_than_the_noise_may_be_off_by(floors: float, left: bool) -> None:
    """A mass that is off by 30 % leaves 1.4 floors of a fast record: at the floor, and yet not nothing."""
    assert leaves_something(model_of(cost=floors**2 * AT_FLOOR, error_m=floors * FLOOR_M)) is left


@pytest.mark.parametrize(("before", "after", "said"), [(1.4, 1.02, True), (4.0, 3.2, False), (4.0, 1.5, True)])
def test_it_is_said_where_most_of_what_was_left_is_gone(before: float, after: float, said: bool) -> None:
    """Of what slips scatter by a mass imitates some: it was "1.73 kg" of a sound valve under a noisy supply."""
    then, now = (model_of(error_m=floors * FLOOR_M).errors for floors in (before, after))
    assert explains_most(then, now, FLOOR_M) is said


@pytest.mark.long
def test_a_mass_that_hides_what_the_recording_shows_is_named() -> None:
    drawn = drawn_valve(np.random.default_rng(11))
    agile = {"mass_kg": LIGHT_KG, "viscous_ns_per_m": 400.0}
    valve = drawn.model_copy(update={"valve": drawn.valve.model_copy(update=agile)})
    recording = record_of(valve, 5, command_pa=excitation(valve.valve, np.random.default_rng(5), 1000))
    heavy = valve.model_copy(update={"valve": valve.valve.model_copy(update={"mass_kg": 8.0})})
    diagnosis = diagnose(recording, heavy, effects=("backlash",))
    found = diagnosis.doubt(KeptMass)
    assert found is not None
    assert not diagnosis.nothing_off
    assert found.sentence(diagnosis.kind) in diagnosis.sentence
    assert abs(found.fitted_kg - LIGHT_KG) < 0.3 * LIGHT_KG
    assert found.fitted_rmse_m < 0.5 * found.kept_rmse_m
    assert found.kept_kg == 8.0
    assert diagnose(recording, valve, effects=("backlash",)).doubts == ()

"""A forward step judged, on models made by hand: what is added, what is refused and why, and what does as well."""

from dataclasses import replace

import pytest

from tests.workbench.hand_made import AT_FLOOR, FLOOR_M, LIBRARY, error_with, fitted, model_of
from workbench.select.effect_candidates import EffectStep, EvaluatedModel, judged_step
from workbench.select.selection_thresholds import SELECTION

POOR = model_of(cost=20.0 * AT_FLOOR, error_m=20.0 * FLOOR_M)
"""The valve as it is, with much to explain."""


def judged(before: EvaluatedModel, **models: EvaluatedModel | str) -> EffectStep:
    return judged_step(before, models, 1, LIBRARY)


def reasons(step: EffectStep) -> dict[str, str]:
    return {each.name: each.rejection_reason for each in step.candidates}


def names(step: EffectStep) -> tuple[str, ...]:
    return tuple(each.name for each in step.indistinguishable)


def test_of_those_accepted_the_one_with_most_evidence_is_added_and_all_stand_by_evidence() -> None:
    step = judged(
        POOR,
        sensor_lag=model_of("sensor_lag", cost=5.0 * AT_FLOOR, error_m=4.0 * FLOOR_M),
        ip_lag=model_of("ip_lag"),
        backlash=POOR,
    )
    assert [each.name for each in step.candidates] == ["ip_lag", "sensor_lag", "backlash"]
    assert reasons(step)["ip_lag"] == reasons(step)["sensor_lag"] == ""
    assert step.added is step.candidates[0]
    assert names(step) == ("ip_lag",), "the other is four times as far off"


def test_of_those_that_the_fitted_part_does_not_tell_the_one_that_explains_what_was_held_out_is_added() -> None:
    missed = model_of("preload", cost=0.999 * AT_FLOOR)
    missed = replace(missed, errors=replace(missed.errors, test_rmse_m=50.0 * FLOOR_M))
    step = judged(POOR, preload=missed, asymmetric_friction=model_of("asymmetric_friction"))
    assert step.candidates[0].name == "preload", "by a hair"
    assert step.added
    assert step.added.name == "asymmetric_friction"
    assert "preload" in names(step), "of what was held out its likelihood is the same"
    evident = model_of("preload", cost=0.9 * AT_FLOOR)
    step = judged(POOR, preload=replace(missed, fit=evident.fit), asymmetric_friction=model_of("asymmetric_friction"))
    assert step.added
    assert step.added.name == "preload"


def test_what_comes_after_another_and_does_no_better_is_neither_added_nor_a_rival() -> None:
    first, more = model_of("presliding", cost=AT_FLOOR), model_of("presliding_hysteresis", cost=0.999 * AT_FLOOR)
    step = judged(POOR, presliding=first, presliding_hysteresis=more)
    assert names(step) == ("presliding",)
    assert "explains no better than presliding" in reasons(step)["presliding_hysteresis"]
    better = model_of("presliding_hysteresis", cost=0.9 * AT_FLOOR)
    step = judged(POOR, presliding=first, presliding_hysteresis=better)
    assert step.added
    assert step.added.name == "presliding_hysteresis"


def test_where_nothing_passes_nothing_is_added() -> None:
    step = judged(POOR, ip_lag=POOR, backlash=POOR)
    assert step.added is None
    assert (step.indistinguishable, step.suspected) == ((), ())
    assert all("evidence" in reason for reason in reasons(step).values())


def test_what_could_not_be_fitted_says_why_and_stands_last() -> None:
    step = judged(POOR, stribeck="the recording holds too little", ip_lag=POOR)
    assert step.candidates[-1].name == "stribeck"
    assert step.candidates[-1].rejection_reason == "the recording holds too little"
    assert not step.candidates[-1].accepted


def drag(value: float) -> EvaluatedModel:
    found = {"quadratic_drag.drag_ns2_per_m2": fitted(value, physical=False)}
    return model_of("quadratic_drag", found=found)


def test_what_the_recording_wants_beyond_its_physical_range_is_refused_however_well_it_fits() -> None:
    step = judged(POOR, quadratic_drag=drag(0.0))
    (candidate,) = step.candidates
    assert not candidate.physical
    assert step.added is None
    assert "quadratic_drag.drag_ns2_per_m2" in candidate.rejection_reason


def test_a_bound_that_is_far_from_the_end_of_the_declared_range_does_not_refuse() -> None:
    (middle,) = LIBRARY["quadratic_drag"].parameters.values()
    start = max(middle.starts_for(POOR.fit.valve.valve))
    assert judged(POOR, quadratic_drag=drag(start)).added


def test_a_class_is_not_ranked_inside() -> None:
    step = judged(
        POOR, sensor_offset=model_of("sensor_offset", cost=0.995 * AT_FLOOR), preload=model_of("preload"), backlash=POOR
    )
    assert step.candidates[0].name == "sensor_offset", "by a hair"
    assert step.added
    assert step.added.name == "preload", "the first by name: no record tells one from the other"
    assert names(step) == ("preload", "sensor_offset")


def test_from_a_class_the_member_whose_search_failed_is_not_gone_on_with_but_stands_in_it() -> None:
    failed = model_of("preload", cost=1.5 * AT_FLOOR, error_m=2.0 * FLOOR_M)
    step = judged(POOR, preload=failed, sensor_offset=model_of("sensor_offset"))
    assert step.added
    assert step.added.name == "sensor_offset"
    assert names(step) == ("preload", "sensor_offset"), "one by algebra, whatever their searches came to"


def test_no_imitation_of_the_bare_valve_is_named() -> None:
    step = judged(
        POOR, sensor_lag=model_of("sensor_lag", cost=1.2 * AT_FLOOR), sensor_gain=model_of("sensor_gain"), backlash=POOR
    )
    assert reasons(step)["sensor_gain"] == "no record of pressure and position tells it from spring_n_per_m"
    assert reasons(step)["sensor_lag"] == "explains no better than sensor_gain, the bare valve with other parameters"
    assert step.added is None
    assert step.bare_equivalent
    assert step.bare_equivalent.name == "sensor_gain"
    assert step.suspected == (), "what is off is a parameter that was kept"


def test_what_explains_more_than_the_bare_valve_by_another_name_is_added() -> None:
    gain = model_of("sensor_gain", cost=5.0 * AT_FLOOR, error_m=5.0 * FLOOR_M)
    step = judged(POOR, sensor_gain=gain, ip_lag=model_of("ip_lag"))
    assert step.added
    assert (step.added.name, names(step)) == ("ip_lag", ("ip_lag",))
    as_good = judged(POOR, sensor_gain=model_of("sensor_gain", cost=2.0 * AT_FLOOR), ip_lag=model_of("ip_lag"))
    assert names(as_good) == ("ip_lag",), "the bare valve by another name is nobody's rival"


def held_out_by(evidence: float, before: EvaluatedModel, effect: str, cost: float) -> EvaluatedModel:
    """Return a model for which what was held out has this evidence over the model before."""
    return model_of(effect, cost=cost, error_m=error_with(evidence, before.errors.test_rmse_m))


def test_what_narrowly_falls_short_of_the_rule_stands_beside_what_narrowly_passes() -> None:
    cost = 0.9 * POOR.fit.cost
    step = judged(
        POOR,
        dead_time=held_out_by(SELECTION.least_held_out - 0.1, POOR, "dead_time", cost),
        sensor_lag=held_out_by(SELECTION.least_held_out + 0.1, POOR, "sensor_lag", 0.999 * cost),
        friction_drift=POOR,
    )
    assert {each.name for each in step.candidates if each.accepted} == {"sensor_lag"}
    (short,) = [each.gain for each in step.candidates if each.name == "dead_time"]
    assert short is not None
    assert short.held_out_evidence == pytest.approx(5.9)
    assert set(names(step)) == {"dead_time", "sensor_lag"}


EXPLAINED = model_of(cost=1.2 * AT_FLOOR, error_m=1.2 * FLOOR_M)
"""The valve as it is, at the floor: nothing is left to explain."""


def test_what_acts_too_rarely_to_show_in_what_was_held_out_is_suspected() -> None:
    """With odds beyond doubt on the fitted part, and nothing held out that speaks against it."""
    rarely = held_out_by(1.0, EXPLAINED, "dwell_stiction", 0.8 * AT_FLOOR)
    step = judged(EXPLAINED, dwell_stiction=rarely, ip_lag=EXPLAINED)
    assert step.added is None
    assert [each.name for each in step.suspected] == ["dwell_stiction"]
    worse = held_out_by(-1.0, EXPLAINED, "dwell_stiction", 0.8 * AT_FLOOR)
    assert judged(EXPLAINED, dwell_stiction=worse).suspected == (), "what was held out speaks against it"
    barely = held_out_by(1.0, EXPLAINED, "dwell_stiction", 1.1 * AT_FLOOR)
    assert judged(EXPLAINED, dwell_stiction=barely).suspected == ()


@pytest.mark.parametrize(("floors", "explained"), [(1.0, False), (0.25, True)])
def test_what_hangs_on_the_state_far_below_the_floor_is_no_matter(floors: float, explained: bool) -> None:
    """Of a stem by its measured pressure: its floor is what the supply's noise makes of it by the command."""
    assert model_of(error_m=floors * FLOOR_M, structure=0.9).explained == explained

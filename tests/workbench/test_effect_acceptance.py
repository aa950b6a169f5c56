"""What a candidate is held against: two evidences, errors of events, structure, classes, what is held out."""

import tracemalloc
from dataclasses import replace
from math import log, pi, sqrt

import numpy as np
import pytest

from config.drive import VALVE
from config.errors import InputError
from config.recording import Recording
from sim.effect import shipped_effect, shipped_effects
from tests.workbench.hand_made import FITTED_EVENTS, FLOOR_M, errors_of, fit_of, model_of
from tests.workbench.valves import SEED, record_of
from workbench.data.held_out import join_recordings, residual_m, split
from workbench.data.record import ready
from workbench.diagnosis.verdict_sentence import reduction_sentence
from workbench.fit.fit_problem import problem
from workbench.fit.fit_result import Known, Term
from workbench.fit.fitting import base_fit
from workbench.model.search_coordinates import Parameter
from workbench.model.told_run import told_moves
from workbench.select.block_errors import block_errors, block_logs, indistinguishable, relative_error_reduction
from workbench.select.effect_acceptance import Gain, evidence_for, gain
from workbench.select.equivalence import algebraic_class, bare_parameter, classes
from workbench.select.residual_structure import structure
from workbench.select.selection_thresholds import SELECTION

LIBRARY = {name: shipped_effect(name, "test") for name in shipped_effects()}
NOISE_M = 5e-5


def moving(count: int = 3000, seed: int = 1) -> Recording:
    generator = np.random.default_rng(seed)
    time_s = 0.01 * np.arange(count)
    position_m = 0.05 + 0.03 * np.sin(1.3 * time_s) + 0.01 * np.sin(4.1 * time_s)
    command_pa = 8e5 * position_m + 5e3 * np.sign(np.gradient(position_m))
    columns = {"time_s": time_s, "command_pa": command_pa}
    return Recording(columns | {"position_m": position_m + NOISE_M * generator.standard_normal(count)})


def noise(count: int, seed: int = 2) -> np.ndarray:
    return NOISE_M * np.random.default_rng(seed).standard_normal(count)


def test_block_errors_are_those_of_one_second_each_and_skip_what_does_not_count() -> None:
    error_m = np.repeat([1e-3, 2e-3, np.nan, 4e-3], 100)
    logs = block_logs(np.linspace(0.0, 3.99, 400), error_m, 0.0)
    assert np.exp(logs) == pytest.approx([1e-3, 2e-3, 4e-3])


def test_an_error_far_below_the_floor_does_not_count_as_a_gain() -> None:
    time_s = np.linspace(0.0, 1.99, 200)
    tiny, none = (block_logs(time_s, np.full(200, each), 1e-5) for each in (1e-9, 0.0))
    assert tiny == pytest.approx(none, abs=1e-6)


def test_a_narrowly_mistimed_slip_does_not_hide_a_gain_in_all_other_blocks() -> None:
    before = np.log(np.full(30, 1e-4))
    after = np.log(np.full(30, 5e-5))
    after[12:15] = np.log(6e-3)
    reduction, standard_errors = relative_error_reduction(before, after)
    assert reduction > 0.05
    assert standard_errors > 2.0


def test_a_slip_met_by_luck_is_no_gain() -> None:
    before = np.log(np.full(30, 5e-5))
    before[12:14] = np.log(6e-3)
    _, standard_errors = relative_error_reduction(before, np.log(np.full(30, 5e-5)))
    assert standard_errors < 2.0


@pytest.mark.parametrize(
    ("train_rmse", "test_rmse", "train_event", "test_event", "there"),
    [
        (1.0, 1.0, 1.0, 1.0, True),
        (2.0, 1.0, 1.0, 1.0, False),
        (1.0, 2.0, 1.0, 1.0, False),
        (1.0, 1.0, 1.7, 1.0, False),
        (1.0, 1.0, 1.0, 1.7, False),
    ],
)
def test_the_floor_is_missed_by_many_events_or_by_far_in_a_few(
    train_rmse: float, test_rmse: float, train_event: float, test_event: float, there: bool
) -> None:
    errors = replace(
        errors_of(),
        train_rmse_m=train_rmse,
        test_rmse_m=test_rmse,
        train_block_m=train_event,
        test_block_m=test_event,
    )
    assert errors.at_floor(1.0) is there
    assert not errors.at_floor(None), "where the floor is unknown nobody can say"


def test_two_are_indistinguishable_that_differ_by_a_narrowly_mistimed_slip_and_not_if_one_is_worse_throughout() -> None:
    best = np.log(np.full(60, 5e-5)) + 0.05 * np.random.default_rng(3).standard_normal(60)
    missed = best.copy()
    missed[40] = np.log(6e-3)
    assert indistinguishable(best, missed)
    assert not indistinguishable(best, best + 0.1)


def test_a_fall_is_never_said_of_an_error_that_rises() -> None:
    before, after = errors_of(1.31e-4), errors_of(1e-4)
    assert reduction_sentence(before, after, VALVE.length) == "the held-out error falls from 0.131 to 0.1 mm"
    before = replace(errors_of(9e-5), test_rmse_m=1.31e-4)
    missed = replace(errors_of(5e-5), test_rmse_m=4.39e-4)
    assert reduction_sentence(before, missed, VALVE.length) == (
        "the held-out error of a typical move falls from 0.09 to 0.05 mm, though the rms rises from 0.131 to 0.439 mm"
    )


@pytest.mark.parametrize("bic", [-50.0, SELECTION.least_evidence, SELECTION.least_evidence + 0.1, 1e4])
@pytest.mark.parametrize("held_out", [-50.0, SELECTION.least_held_out, SELECTION.least_held_out + 0.1, 1e4])
def test_what_was_fitted_and_what_was_held_out_must_both_say_that_it_is_there(bic: float, held_out: float) -> None:
    reason = Gain(bic, 0.3, held_out).rejection_reason
    assert (reason == "") == (bic > SELECTION.least_evidence and held_out > SELECTION.least_held_out)
    if bic <= SELECTION.least_evidence:
        assert f"evidence {bic:.3g}, more than 10 needed" in reason
        assert reason.startswith("may be chance") == (bic >= -SELECTION.least_evidence)
    elif held_out <= SELECTION.least_held_out:
        assert f"evidence {held_out:.3g} there, more than 6 needed" in reason


def test_evidence_is_what_each_kind_of_residual_says_by_as_many_as_are_independent() -> None:
    """Twice the log-likelihood, each kind at the scale that it leaves, less log n a parameter more."""
    base = fit_of()
    told = replace(base, terms=replace(base.terms, landings=Term(FITTED_EVENTS, 0.5)))
    assert evidence_for(told, base) == pytest.approx(FITTED_EVENTS * log(2.0))
    assert evidence_for(told, base) == -evidence_for(base, told)
    more = fit_of("ip_lag")
    assert evidence_for(more, base) == pytest.approx(-log(2.0 * FITTED_EVENTS)), "it is paid for, whatever it leaves"


@pytest.mark.parametrize("deviation", [1.0, 1e-2, 1e-4])
def test_a_parameter_is_paid_for_by_how_little_of_its_range_is_left(deviation: float) -> None:
    """A quantum that is known to a part in 10 000 was sought at 10 000 places: one of them fits by chance."""
    base, quantised = fit_of(), fit_of("quantisation")
    (name,) = quantised.parameters.keys() - base.parameters.keys()
    found = replace(quantised, known=Known((Parameter(name, 7, 1e-6, 1e-3),), np.array([[1.0 / deviation]])))
    occam = 2.0 * log(log(1e3) / (sqrt(2.0 * pi) * deviation))
    evidence = evidence_for(found, base)
    assert type(evidence) is float, "what hangs on it goes into JSON"
    assert evidence == pytest.approx(-max(log(2.0 * FITTED_EVENTS), occam))


def test_what_hangs_together_counts_for_as_many_as_are_independent() -> None:
    base = fit_of()
    few = replace(base.terms, motion=Term(3.0, 0.01))
    assert few.nats_above(base.terms) == pytest.approx(1.5 * log(100.0))
    assert base.terms.nats_above(few) == pytest.approx(-1.5 * log(100.0)), "of two the fewer"


def test_of_what_was_held_out_no_parameter_is_paid_for() -> None:
    base, better = model_of(), model_of("ip_lag", error_m=0.5 * FLOOR_M)
    found = gain(base.fit, better.fit, base.errors, better.errors)
    independent = sum(each.independent for each in base.errors.held_out.each)
    assert found.held_out_evidence == pytest.approx(independent * log(4.0))
    assert found.held_out == pytest.approx(0.5)


def test_what_was_fitted_is_no_evidence_of_what_was_held_out() -> None:
    """Where the end of a recording is held out, its moves alone are."""
    recording = record_of(SEED, 2)
    parts = split([recording])
    errors = block_errors(base_fit(problem(parts.train.record, SEED.valve), SEED), parts)
    told = [each for each in told_moves(parts.test.record) if parts.test.counted[each.after : each.until + 1].any()]
    assert 0 < len(told) < len(told_moves(parts.test.record))
    assert errors.held_out.break_aways.independent <= len(told)
    assert errors.held_out.landings.independent <= len(told)


@pytest.mark.parametrize(("deviations", "holds"), [(0.0, True), (1.0, True), (40.0, False)])
def test_what_was_held_out_may_have_the_valve_where_its_fit_leaves_it_open_and_no_farther(
    deviations: float, holds: bool
) -> None:
    parts = split([record_of(SEED, 2)])
    fit = base_fit(problem(parts.train.record, SEED.valve), SEED)
    spring = fit.parameters["spring_n_per_m"]
    moved = spring.value + deviations * spring.std
    off = replace(
        fit, valve=SEED.model_copy(update={"valve": fit.valve.valve.model_copy(update={"spring_n_per_m": moved})})
    )
    errors = block_errors(off, parts)
    assert (errors.test_rmse_m < 1.2 * parts.scale_m) == holds


def test_noise_has_no_structure() -> None:
    record = ready(moving())
    assert max(structure(record, noise(3000, seed)) for seed in range(10)) < SELECTION.most_structure


@pytest.mark.parametrize("cause", ["direction", "position", "pressure", "time"])
def test_a_residual_that_hangs_on_the_state_is_structured(cause: str) -> None:
    record = ready(moving())
    shapes = {
        "direction": np.sign(np.gradient(record.command_pa)),
        "position": ((record.position_m - 0.05) / 0.02) ** 2,
        "pressure": (record.command_pa - 4e4) / 2e4,
        "time": record.time_s / 15.0,
    }
    assert structure(record, noise(3000) + NOISE_M * shapes[cause]) > SELECTION.most_structure


def test_what_never_changes_is_no_state_that_a_residual_could_hang_on() -> None:
    recording = moving()
    still = Recording({**recording.columns, "command_pa": np.full(3000, 4e4)})
    assert structure(ready(still), noise(3000)) < SELECTION.most_structure


def test_a_missed_slip_is_not_structure_and_does_not_hide_it() -> None:
    record = ready(moving())
    slip_m = np.zeros(3000)
    slip_m[1500:1580] = 8e-3
    assert structure(record, noise(3000) + slip_m) < SELECTION.most_structure
    either_way_m = NOISE_M * np.sign(np.gradient(record.command_pa))
    assert structure(record, noise(3000) + either_way_m + slip_m) > SELECTION.most_structure


def test_of_a_long_record_the_regressors_are_held_once() -> None:
    record = ready(moving(20_000))
    error = noise(20_000)
    tracemalloc.start()
    structure(record, error)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2 * 27 * error.nbytes


def test_preload_and_sensor_offset_are_one_class_and_gain_is_the_spring() -> None:
    assert (
        algebraic_class("preload", LIBRARY)
        == algebraic_class("sensor_offset", LIBRARY)
        == {
            "preload",
            "sensor_offset",
        }
    )
    assert bare_parameter("sensor_gain", LIBRARY) == "spring_n_per_m"
    assert bare_parameter("preload", LIBRARY) is None
    assert bare_parameter("preload", {"preload": LIBRARY["preload"]}) is None


def test_classes_keep_the_order_of_their_first_member() -> None:
    gathered = classes(["sensor_offset", "backlash", "preload"], LIBRARY)
    assert gathered == [{"sensor_offset", "preload"}, {"backlash"}]


def test_the_end_is_held_out_and_the_fit_never_sees_it() -> None:
    recording = moving(900)
    parts = split([recording])
    assert len(parts.train.recording) == 600
    counted = np.isfinite(residual_m(parts.test, recording.position_m))
    assert not counted[:600].any()
    assert counted[600:].all()


def test_another_recording_is_held_out_whole() -> None:
    parts = split([moving(300)], moving(200, seed=9))
    assert len(parts.train.recording) == 300
    assert parts.test.counted.sum() == 200


def test_recordings_one_after_another_begin_anew_and_keep_what_all_have() -> None:
    one, other = moving(300), moving(200, seed=9)
    extra = Recording({**one.columns, "pressure_pa": one.command_pa})
    whole = join_recordings([extra, other])
    assert set(whole.columns) == {"time_s", "command_pa", "position_m"}
    assert ready(whole).segments == ((0, 300), (300, 500))


def test_too_little_to_hold_some_out_is_said() -> None:
    with pytest.raises(InputError, match="33 samples held out are too few"):
        split([moving(100)])


def test_what_the_arithmetic_leaves_has_no_structure() -> None:
    record = ready(moving())
    left_m = 1e-4 * (noise(3000) + NOISE_M * np.sign(np.gradient(record.command_pa)))
    assert structure(record, left_m) > SELECTION.most_structure
    assert structure(record, left_m, 0.1 * NOISE_M) < SELECTION.most_structure

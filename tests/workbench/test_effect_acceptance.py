"""What a candidate is held against: block errors, the meter of structure, algebraic classes, what is held out."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from config.drive import VALVE
from config.errors import InputError
from config.recording import Recording
from sim.effect import shipped_effect, shipped_effects
from tests.workbench.hand_made import FLOOR_M, model_of
from workbench.data.held_out import joined, residual_m, split
from workbench.data.record import ready
from workbench.diagnosis.verdict_sentence import reduction_sentence
from workbench.select.block_errors import (
    BlockErrors,
    Told,
    block_logs,
    independent_share,
    indistinguishable,
    relative_error_reduction,
)
from workbench.select.effect_acceptance import Gain
from workbench.select.effect_acceptance import gain as gain_of
from workbench.select.equivalence import algebraic_class, bare_parameter, classes
from workbench.select.residual_structure import STRUCTURED, structure

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
    gain, standard_errors = relative_error_reduction(before, after)
    assert gain > 0.05
    assert standard_errors > 2.0


def test_a_slip_met_by_luck_is_no_gain() -> None:
    before = np.log(np.full(30, 5e-5))
    before[12:14] = np.log(6e-3)
    _, standard_errors = relative_error_reduction(before, np.log(np.full(30, 5e-5)))
    assert standard_errors < 2.0


@pytest.mark.parametrize(
    ("train_rmse", "told_rmse", "train_block", "test_block", "there"),
    [
        (1.0, 1.0, 1.0, 1.0, True),
        (2.0, 1.0, 1.0, 1.0, False),
        (1.0, 2.0, 1.0, 1.0, False),
        (1.0, 1.0, 1.7, 1.0, False),
        (1.0, 1.0, 1.0, 1.7, False),
    ],
)
def test_the_floor_is_missed_by_many_blocks_or_by_far_in_a_few(
    train_rmse: float, told_rmse: float, train_block: float, test_block: float, there: bool
) -> None:
    none = np.zeros(0)
    rmse = (train_rmse, 20.0, train_block, test_block)
    errors = BlockErrors(*rmse, none, none, 0.0, 1.0, told=Told(told_rmse, test_block))
    assert errors.at_floor(1.0) is there
    assert not errors.at_floor(None), "where the floor is unknown nobody can say"


def errors_of(logs: np.ndarray) -> BlockErrors:
    return BlockErrors(1e-4, 1e-4, 1e-4, 1e-4, logs[30:], logs, 0.0, 1.0)


def test_two_are_indistinguishable_that_differ_by_a_narrowly_mistimed_slip_and_not_if_one_is_worse_throughout() -> None:
    best = np.log(np.full(60, 5e-5)) + 0.05 * np.random.default_rng(3).standard_normal(60)
    missed = best.copy()
    missed[40] = np.log(6e-3)
    assert indistinguishable(best, missed)
    assert not indistinguishable(best, best + 0.1)


def test_a_fall_is_never_said_of_an_error_that_rises() -> None:
    before = replace(errors_of(np.zeros(60)), test_rmse_m=1.31e-4, test_block_m=9e-5)
    assert (
        reduction_sentence(before, errors_of(np.zeros(60)), VALVE.length)
        == "the held-out error falls from 0.131 to 0.1 mm"
    )
    missed = replace(before, test_rmse_m=4.39e-4, test_block_m=5e-5)
    assert reduction_sentence(before, missed, VALVE.length) == (
        "the held-out error of a typical second falls from 0.09 to 0.05 mm, "
        "though a narrowly mistimed slip moves the rms from 0.131 to 0.439 mm"
    )


def test_what_hangs_together_is_few_independent_samples() -> None:
    white = noise(20000)
    assert independent_share(white) == pytest.approx(1.0, abs=0.03)
    wandering = np.zeros(20000)
    for i in range(1, wandering.size):
        wandering[i] = 0.9 * wandering[i - 1] + white[i]
    assert independent_share(wandering) == pytest.approx(0.1 / 1.9, rel=0.15)
    wandering[::7] = np.nan
    assert independent_share(wandering) == pytest.approx(0.1 / 1.9, rel=0.2)
    assert independent_share(np.zeros(100)) == 1.0


@pytest.mark.parametrize(
    ("gain", "said"),
    [
        (Gain(9.0, 0.5, 9.0, 1.0), "evidence 9"),
        (Gain(90.0, 0.04, 9.0, 1.0), "falls by 4 %"),
        (Gain(90.0, -0.11, -9.0, 1.0), "rises by 11 %, a fall of more than 5 % needed"),
        (Gain(90.0, 0.5, 1.9, 1.0), "1.9 times its own uncertainty"),
    ],
)
def test_each_part_of_the_rule_can_refuse_and_says_so(gain: Gain, said: str) -> None:
    assert said in gain.rejection_reason(at_floor=False)


def test_what_passes_every_part_is_not_refused() -> None:
    assert not Gain(11.0, 0.06, 2.1, 0.3).rejection_reason(at_floor=False)
    assert "evidence 11 counts for 1.1, more than 3" in Gain(11.0, 0.06, 2.1, 0.1).rejection_reason(at_floor=False)
    assert not Gain(1e3, 0.4, 3.1, 1e-5).rejection_reason(at_floor=False), "one arc, held out too"
    assert "evidence 90 counts for 9, more than 10" in Gain(90.0, 0.5, 9.0, 0.1).rejection_reason(at_floor=True)
    assert "more than 3 needed" in Gain(11.0, 0.06, 2.9, 1.0).rejection_reason(at_floor=True)
    assert not Gain(11.0, 0.06, 3.1, 1.0).rejection_reason(at_floor=True)


def test_what_acts_rarely_and_leaves_nothing_need_not_show_in_many_blocks() -> None:
    rare = Gain(1000.0, 0.06, 1.5, 0.9, completes=True)
    assert not rare.rejection_reason(at_floor=True)
    assert "more than 3 needed" in replace(rare, completes=False).rejection_reason(at_floor=True)
    assert "more than 3 needed" in replace(rare, bic=100.0).rejection_reason(at_floor=True), "90 independent: chance"
    assert "more than 1 needed" in replace(rare, standard_errors=0.9).rejection_reason(at_floor=True)
    assert "a fall of more than 5 %" in replace(rare, held_out=0.04).rejection_reason(at_floor=True)
    seen = replace(rare, held_out=0.03, standard_errors=3.1)
    assert not seen.rejection_reason(at_floor=True), "in one block of twenty, which the mean of all cannot show better"
    assert "a fall of more than 5 %" in replace(seen, completes=False).rejection_reason(at_floor=True)
    assert "a fall of more than 5 %" in replace(seen, bic=100.0).rejection_reason(at_floor=True)


@pytest.mark.parametrize(
    ("floors_before", "floors_after", "floor_m", "completes"),
    [(1.3, 1.0, FLOOR_M, True), (1.1, 1.0, FLOOR_M, False), (1.3, 1.2, FLOOR_M, False), (1.3, 1.0, None, False)],
)
def test_it_completes_what_leaves_more_than_the_noise_may_be_off_by(
    floors_before: float, floors_after: float, floor_m: float | None, completes: bool
) -> None:
    before, after = (model_of(error_m=floors * FLOOR_M) for floors in (floors_before, floors_after))
    assert gain_of(before.fit, after.fit, before.errors, after.errors, floor_m).completes == completes


def test_noise_has_no_structure() -> None:
    record = ready(moving())
    assert max(structure(record, noise(3000, seed)) for seed in range(10)) < STRUCTURED


@pytest.mark.parametrize("cause", ["direction", "position", "pressure", "time"])
def test_a_residual_that_hangs_on_the_state_is_structured(cause: str) -> None:
    record = ready(moving())
    shapes = {
        "direction": np.sign(np.gradient(record.command_pa)),
        "position": ((record.position_m - 0.05) / 0.02) ** 2,
        "pressure": (record.command_pa - 4e4) / 2e4,
        "time": record.time_s / 15.0,
    }
    assert structure(record, noise(3000) + NOISE_M * shapes[cause]) > STRUCTURED


def test_a_missed_slip_is_not_structure_and_does_not_hide_it() -> None:
    record = ready(moving())
    slip_m = np.zeros(3000)
    slip_m[1500:1580] = 8e-3
    assert structure(record, noise(3000) + slip_m) < STRUCTURED
    assert structure(record, noise(3000) + NOISE_M * np.sign(np.gradient(record.command_pa)) + slip_m) > STRUCTURED


def test_of_a_long_record_the_regressors_are_held_once() -> None:
    record = ready(moving(60_000))
    error = noise(60_000)
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
    whole = joined([extra, other])
    assert set(whole.columns) == {"time_s", "command_pa", "position_m"}
    assert ready(whole).segments == ((0, 300), (300, 500))


def test_too_little_to_hold_some_out_is_said() -> None:
    with pytest.raises(InputError, match="33 samples held out are too few"):
        split([moving(100)])


def test_what_the_arithmetic_leaves_has_no_structure() -> None:
    record = ready(moving())
    left_m = 1e-4 * NOISE_M * np.sin(1.3 * record.time_s)
    assert structure(record, left_m) > STRUCTURED
    assert structure(record, left_m, 0.1 * NOISE_M) < STRUCTURED

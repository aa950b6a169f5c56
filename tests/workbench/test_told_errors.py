"""What was held out, told when the stem moves: static friction that the record leaves open is no error of the model."""

from dataclasses import replace

import numpy as np

from config.valve_file import ValveFile
from tests.workbench.hand_made import fit_of
from tests.workbench.test_likelihood import recording
from tests.workbench.valves import NOISE_M, SEED
from workbench.data.held_out import Split, split
from workbench.fit.fit_result import Fit
from workbench.select.told_errors import told_error_m


def with_base(**changes: float) -> ValveFile:
    return ValveFile(valve=SEED.valve.model_copy(update=changes))


def parts(test: ValveFile = SEED) -> Split:
    return split([recording(SEED, 3)], recording(test, 4))


def fit_by(valve: ValveFile) -> Fit:
    return replace(fit_of(), valve=valve)


def rms_m(error_m: np.ndarray) -> float:
    return float(np.sqrt(np.nanmean(error_m**2)))


def test_a_slip_that_static_friction_mistimes_is_no_error_where_the_stem_is_told() -> None:
    on, fit = parts(), fit_by(with_base(static_n=1.05 * SEED.valve.static_n))
    free_m = fit.indicated_m(on.test.record) - on.test.record.position_m
    told_m = told_error_m(fit, on)
    assert told_m is not None
    assert rms_m(told_m) < 1.2 * NOISE_M
    assert rms_m(free_m) > 3.0 * rms_m(told_m)


def test_another_spring_is_an_error_told_or_not() -> None:
    told_m = told_error_m(fit_by(with_base(spring_n_per_m=1.02 * SEED.valve.spring_n_per_m)), parts())
    assert told_m is None or rms_m(told_m) > 5.0 * NOISE_M


def test_break_aways_that_no_one_static_friction_does_for_are_not_left_open() -> None:
    stiffer = with_base(static_n=1.3 * SEED.valve.static_n)
    assert told_error_m(fit_by(SEED), parts(stiffer)) is None

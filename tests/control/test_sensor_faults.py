"""A position sensor that jumps or freezes in the middle of S3: nothing wrong is ever applied."""

from math import inf, nan

import pytest

from benchmarks.sensor_faults import EXPERIMENTS, NO_FAULT, STROKE_M, SensorFault, identified, off
from config.codes import Refusal
from positioner.estimation.refiner import InProcessRefiner, RefinementJob
from tests.cases import few_always

SINE, *STAIRCASES = EXPERIMENTS
JUMPS = [SensorFault(at_s, inf, by * STROKE_M) for by in (0.02, 0.1, -0.1) for at_s in (0.25, 0.5, 0.8)]
SHORT = [SensorFault(0.5, 1e-3, 0.1 * STROKE_M), SensorFault(0.4, 0.2, nan), SensorFault(0.7, 0.2, -0.02 * STROKE_M)]


def wrong(fault: SensorFault, seed: int = 0) -> bool:
    """Whether S3 by a sine applies what is off by more than its deviations."""
    decision, _ = identified(SINE, fault, seed)
    by_m = fault.by_m if fault.by_m == fault.by_m else 0.0
    return decision.applied.ratios is not None and min(off(SINE, decision, each) for each in (0.0, by_m)) > 1.0


@pytest.mark.parametrize("fault", few_always([*SHORT, *JUMPS], 2), ids=str)
def test_a_sine_with_a_sensor_that_jumps_applies_nothing_wrong(fault: SensorFault) -> None:
    assert not wrong(fault)


@pytest.mark.parametrize("fault", few_always([JUMPS[0], JUMPS[4], *JUMPS], 2), ids=str)
def test_nor_where_nobody_refines(fault: SensorFault, monkeypatch: pytest.MonkeyPatch) -> None:
    """The algebraic estimates have a residual of their own."""

    def nobody(_self: InProcessRefiner, _job: RefinementJob) -> bool:
        return False

    monkeypatch.setattr(InProcessRefiner, "submit", nobody)
    assert not wrong(fault)


def test_the_reason_is_that_the_model_does_not_fit() -> None:
    decision, _ = identified(SINE, SensorFault(0.5, inf, 0.1 * STROKE_M), 0)
    assert decision.applied.ratios is None
    assert decision.applied.last_refusal is Refusal.MODEL_DOES_NOT_FIT


SLOW = STAIRCASES[-1]
SHIFTS = [
    SensorFault(at_s, inf, by * STROKE_M)
    for at_s, by in ((6.0, 0.2), (9.98, -0.1), (10.7, 0.02), (6.0, 0.02), (10.7, 0.2), (12.0, -0.1))
]


@pytest.mark.parametrize("fault", few_always(SHIFTS, 3), ids=str)
def test_a_staircase_with_a_sensor_that_jumps_applies_nothing_wrong(fault: SensorFault) -> None:
    """On the way up, at the turn, in the first slide down, on the way down: there is a last landing up to tell."""
    decision, _ = identified(SLOW, fault, 3)
    if decision.applied.ratios is None:
        assert decision.applied.last_refusal is not Refusal.VALID
        assert not decision.static_law.valid
    else:
        assert min(off(SLOW, decision, each) for each in (0.0, fault.by_m)) < 1.0


LOOKS_LIKE_A_SWING = [
    (1, SensorFault(3.383, inf, -0.038 * STROKE_M), 269),
    (2, SensorFault(13.9404, 0.8805, -0.2244 * STROKE_M), 15),
    (2, SensorFault(4.0394, inf, -0.0076 * STROKE_M), 80),
]


@pytest.mark.parametrize(("number", "fault", "seed"), LOOKS_LIKE_A_SWING, ids=str)
def test_a_jump_about_the_longest_way_is_not_taken_for_a_stem_that_swings(
    number: int, fault: SensorFault, seed: int
) -> None:
    """One landing alone, or all before an instant, would have the stem swing past its balance."""
    decision, _ = identified(EXPERIMENTS[number], fault, seed)
    assert decision.static_law.swing == 0.0
    if decision.applied.ratios is not None:
        assert min(off(EXPERIMENTS[number], decision, each) for each in (0.0, fault.by_m)) < 1.0


def test_a_staircase_without_a_fault_is_applied() -> None:
    decision, _ = identified(SLOW, NO_FAULT, 3)
    assert off(SLOW, decision, 0.0) < 1.0

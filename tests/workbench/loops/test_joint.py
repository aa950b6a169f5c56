from dataclasses import replace

import pytest

from benchmarks.drawn_loops import draw_loop
from workbench.loops import LoopDiagnosis, LoopRecord, diagnose_loop
from workbench.loops.joint import together


@pytest.fixture(scope="module")
def sticking() -> LoopDiagnosis:
    loop = draw_loop(10, "sticks")
    return diagnose_loop(LoopRecord.of_samples("FIC101", loop.time_s, loop.op_pct, loop.pv, loop.sp))


def of_evidence(each: LoopDiagnosis, nats: float) -> LoopDiagnosis:
    """Return the same with this evidence, of 50 nats that friction explains."""
    assert each.causes is not None
    costs = {"friction": 0.0, "linear": nats, "nonlinear": 90.0, "disturbance": 50.0}
    return replace(each, causes=replace(each.causes, costs=costs))


def test_records_that_leave_it_open_each_tell_together(sticking: LoopDiagnosis) -> None:
    one = of_evidence(sticking, 25.0)
    alone, all_of_them = together([one]), together([one] * 8)
    assert alone.probability is not None
    assert all_of_them.probability is not None
    assert alone.probability < all_of_them.probability
    assert all_of_them.stiction_pct is not None
    assert all_of_them.stiction_pct[1] < 5.8 < all_of_them.stiction_pct[2]


def test_evidence_against_friction_counts_as_well(sticking: LoopDiagnosis) -> None:
    found = together([of_evidence(sticking, 25.0), of_evidence(sticking, -40.0)])
    assert found.probability == together([of_evidence(sticking, -1.0)]).probability


def test_what_is_insufficient_is_left_out(sticking: LoopDiagnosis) -> None:
    assert together([replace(sticking, causes=None)]).probability is None
    assert together([sticking, replace(sticking, causes=None)]).records == 1

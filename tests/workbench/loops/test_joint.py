from dataclasses import replace

import pytest

from workbench.bench.drawn_loops import draw_loop
from workbench.loops import LoopDiagnosis, LoopRecord, diagnose_loop
from workbench.loops.calibration import Evidence, Witness
from workbench.loops.causes import Size
from workbench.loops.joint import together


@pytest.fixture(scope="module")
def sticking() -> LoopDiagnosis:
    loop = draw_loop(10, "sticks")
    return diagnose_loop(LoopRecord.of_samples("FIC101", loop.time_s, loop.op_pct, loop.pv, loop.sp))


def of_evidence(each: LoopDiagnosis, nats: float) -> LoopDiagnosis:
    """Return the same with this evidence, of 50 nats that friction explains."""
    return replace(each, evidence=Evidence(Witness(nats, 50.0), Witness()))


def test_a_record_that_tells_is_heard_among_others_that_do_not(sticking: LoopDiagnosis) -> None:
    open_ones, telling = [of_evidence(sticking, 0.0)] * 3, of_evidence(sticking, 200.0)
    alone, all_of_them = together(open_ones), together([*open_ones, telling])
    assert alone.probability is not None
    assert all_of_them.probability is not None
    assert alone.probability < 0.5 < all_of_them.probability
    assert all_of_them.size is not None
    assert all_of_them.size.low_pct < 5.8 < all_of_them.size.high_pct


def test_the_same_record_again_tells_no_more(sticking: LoopDiagnosis) -> None:
    assert together([sticking] * 5).probability == pytest.approx(sticking.probability)


def test_evidence_against_friction_counts_as_well(sticking: LoopDiagnosis) -> None:
    found = together([of_evidence(sticking, 25.0), of_evidence(sticking, -40.0)])
    assert found.probability == pytest.approx(together([of_evidence(sticking, -7.5)]).probability)


def test_what_is_insufficient_is_left_out(sticking: LoopDiagnosis) -> None:
    assert together([replace(sticking, causes=None)]).probability is None
    assert together([sticking, replace(sticking, causes=None)]).records == 1


def test_records_that_disagree_of_how_much_leave_s_open(sticking: LoopDiagnosis) -> None:
    causes = sticking.causes
    assert causes is not None
    twice = replace(causes, friction=replace(causes.friction, size=Size.of(12.0, 12.0, 12.0)))
    one, both = together([sticking]).size, together([sticking] * 3 + [replace(sticking, causes=twice)]).size
    assert one == causes.friction.size
    assert one.told
    assert both == Size(one.stiction_pct, one.low_pct, 1.2 * 12.0)
    assert not both.told

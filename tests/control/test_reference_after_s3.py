"""A reference at which the stem already stood when S3 took it away."""

from config.codes import InhibitReason
from positioner.daemon.health.ne107 import ne107_condition
from tests.control.pneumatic_valve import STROKE_M, Loop, identified


def test_the_stem_goes_back_where_it_is_asked_to_be() -> None:
    loop = identified()
    assert abs(loop.error_at(0.5)) > 0.01
    assert abs(loop.step_to(0.5, 30.0)) < 1e-3


def test_it_goes_back_by_itself_where_that_was_asked_before() -> None:
    loop = Loop()
    loop.step_to(0.5, 1.0)
    loop.identified().cycles(30.0)
    assert abs(loop.error_at(0.5)) < 1e-3


def test_it_stays_where_nobody_asks() -> None:
    loop = identified()
    stands_m = loop.valve.stem_m
    loop.cycles(30.0)
    assert loop.valve.stem_m == stands_m


def test_until_somebody_asks_the_reference_is_where_the_stem_is() -> None:
    """A first identification ended "away from the reference": the stem had gone on as the command came back."""
    loop = identified()
    loop.valve.stem_m += 0.1 * STROKE_M
    loop.cycles(3.0)
    assert abs(loop.decision.reference_m - loop.valve.stem_m) < 1e-3 * STROKE_M
    assert ne107_condition(loop.decision, loop.health).causes == ()
    assert loop.why is InhibitReason.NO_MOVE_ASKED

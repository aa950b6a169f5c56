"""A reference at which the stem already stood when S3 took it away."""

from tests.control.pneumatic_valve import Loop, identified


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

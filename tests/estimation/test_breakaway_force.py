"""Static friction from break-aways: intervals that are narrowed, not averaged."""

from math import nan

import numpy as np
import pytest

from config.codes import Refusal
from positioner.estimation.breakaway_force import after_event, from_interval, intersection, with_validity
from positioner.estimation.estimates import Estimate, no_estimate
from tests.estimation.stem import AREA, COULOMB, NOISE, SPRING, STATIC, STROKE, rested

PERIOD_S, EVERY_S = 2e-3, 20.0


def test_two_events_leave_what_their_intervals_share() -> None:
    both = intersection(from_interval(20.0, 30.0), from_interval(24.0, 60.0))
    assert both.value == pytest.approx(27.0)
    assert both.std == pytest.approx(6 / 12**0.5)


def test_many_wide_events_do_not_make_a_narrow_one() -> None:
    known = from_interval(22.0, 60.0)
    for _ in range(50):
        known = intersection(known, from_interval(22.0, 60.0))
    assert known.std == pytest.approx(38 / 12**0.5)
    assert with_validity(known, 0.05).reason is Refusal.TOO_UNCERTAIN


def test_events_that_share_nothing_leave_what_lies_between() -> None:
    both = intersection(from_interval(20.0, 22.0), from_interval(26.0, 30.0))
    assert 22.0 < both.value < 26.0
    assert both.std == pytest.approx(4 / 12**0.5)


def test_what_is_known_ages_and_a_move_without_an_event_takes_nothing_away() -> None:
    known, no_event = from_interval(26.0, 27.0), no_estimate(Refusal.WAITING_FOR_MOTION)
    assert after_event(no_event, known, 10.0) == known
    aged = after_event(known, no_event, 600.0)
    assert aged.value == known.value
    assert aged.std > 2 * known.std
    assert after_event(aged, known, 1.0).std == pytest.approx(known.std)
    assert with_validity(Estimate(nan, nan, Refusal.WAITING_FOR_MOTION), 0.05).reason is Refusal.WAITING_FOR_MOTION


@pytest.mark.parametrize("ramp_s", [0.2, 0.0], ids=["ramps", "jumps"])
def test_ordinary_moves_tell_the_static_friction_if_they_begin_slowly(ramp_s: float) -> None:
    valve, identification = rested()
    pressure_pa, rng = valve.pressure_pa, np.random.default_rng(0)
    for move in range(8):
        target_m = STROKE * float(rng.uniform(0.3, 0.8))
        direction = 1 if target_m > valve.position_m else -1
        begin_pa, end_pa = pressure_pa, (SPRING * target_m + direction * 1.3 * STATIC) / AREA
        for row in range(400):
            share = min(1.0, (row - 100) * PERIOD_S / ramp_s) if ramp_s and row > 100 else float(row > 100)
            pressure_pa = begin_pa + share * (end_pa - begin_pa)
            valve.advance(pressure_pa, PERIOD_S)
            position_m = valve.position_m + float(rng.normal(0, NOISE))
            identification.update(
                EVERY_S * move + PERIOD_S * row,
                position_m,
                valve.pressure_pa,
                parameters=True,
                friction=True,
                passive=True,
            )
    known = identification.estimates.breakaway
    assert abs(known.value - STATIC / AREA) < 3 * known.std
    assert known.value > COULOMB / AREA
    assert known.valid == bool(ramp_s)

"""When a measured pressure has arrived, and what is not believed to be one."""

from math import exp, inf, nan

import pytest

from positioner.estimation.landings.landing_detector import LandingDetector
from positioner.estimation.landings.pressure_arrival import PressureArrival

PERIOD_S = 0.02


def after_step(arrival: PressureArrival, lag_s: float, step_pa: float, answer_s: float | None = None) -> None:
    """Let a measured pressure of a lag follow a step from 50 kPa; the stem comes to rest after a time."""
    arrival.restart(0.0, 50e3, 50e3, 50e3 + step_pa, at_rest=True)
    time_s = 0.0
    while arrival.awaited and time_s < 60.0:
        time_s += PERIOD_S
        arrival.add(time_s, 50e3 + step_pa * (1.0 - exp(-time_s / lag_s) if lag_s else 1.0))
    if answer_s is not None:
        arrival.learn(answer_s)


def test_a_stem_has_answered_some_time_after_the_pressure_has_arrived() -> None:
    arrival = PressureArrival()
    after_step(arrival, 0.1, 20e3, answer_s=0.5)
    assert arrival.after_s == pytest.approx(0.36)
    after_step(arrival, 0.05, 1e3)
    assert arrival.answered_s == pytest.approx(0.18 + 0.14)


def test_a_device_that_repeats_its_command_is_not_believed() -> None:
    arrival = PressureArrival()
    after_step(arrival, 0.0, 20e3, answer_s=0.5)
    assert arrival.answered_s == inf


def test_a_pressure_that_is_not_measured_never_arrives() -> None:
    arrival = PressureArrival()
    arrival.restart(0.0, nan, 50e3, 60e3, at_rest=True)
    arrival.add(1.0, nan)
    arrival.learn(2.0)
    assert arrival.answered_s == inf


def test_an_offset_of_the_measurement_is_known_from_the_rest_before() -> None:
    arrival = PressureArrival()
    arrival.restart(0.0, 51e3, 50e3, 60e3, at_rest=True)
    arrival.add(0.1, 55e3)
    assert arrival.awaited
    arrival.add(0.2, 61e3)
    assert arrival.after_s == pytest.approx(0.2)


@pytest.mark.parametrize(("measured", "within_s"), [(True, 0.5), (False, 3.0)], ids=["measured", "not"])
def test_a_stem_that_a_small_step_did_not_move_is_not_waited_for_as_after_a_large_one(
    measured: bool, within_s: float
) -> None:
    """Under a rate limit of 20 kPa/s: a large step takes a second and a half, a small one no time."""
    detector, rate_pa_per_s = LandingDetector(0.1), 20e3
    time_s, pressure_pa, position_m = 0.0, 50e3, 0.05

    def waited_s(command_pa: float, metres_per_pa: float) -> float:
        nonlocal time_s, pressure_pa, position_m
        began_s = time_s
        while time_s < began_s + 10.0:
            seen_pa = pressure_pa if measured else nan
            if detector.update(time_s, position_m, command_pa, seen_pa) is not None:
                break
            time_s += PERIOD_S
            change_pa = max(-rate_pa_per_s * PERIOD_S, min(rate_pa_per_s * PERIOD_S, command_pa - pressure_pa))
            pressure_pa, position_m = pressure_pa + change_pa, position_m + metres_per_pa * change_pa
        return time_s - began_s

    waited_s(50e3, 0.0)
    waited_s(80e3, 1e-6)
    small_s = waited_s(82e3, 0.0)
    assert within_s - 1.0 < small_s < within_s

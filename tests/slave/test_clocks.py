"""The two clocks over the seed's valve, in a time the test gives."""

import logging
from typing import Any

import pytest

from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from sim.slave.clocks import Lockstep, RealTime
from sim.slave.simulated_device import Device
from sim.slave.slave import device_of


def switched_on(**tables: Any) -> Device:
    return device_of(SlaveFile.model_validate(tables), shipped_valve("seed"))


class Time:
    ns = 10_000_000_000

    def __call__(self) -> int:
        return self.ns

    def pass_s(self, seconds: float) -> None:
        self.ns += round(1e9 * seconds)


def test_lockstep_passes_one_period_a_command_and_none_otherwise() -> None:
    device = switched_on()
    clock = Lockstep(device)
    for _ in range(3):
        clock.catch_up()
        clock.command(30e3)
    assert device.device_time_us == 3000


def test_real_time_samples_on_its_own_grid() -> None:
    device, time = switched_on(), Time()
    clock = RealTime(device, 1000, time)
    for passed_s, counter in ((0.0004, 0), (0.0004, 0), (0.0004, 1), (0.0104, 11), (0.0, 11)):
        time.pass_s(passed_s)
        clock.catch_up()
        assert (device.sample_counter, device.device_time_us) == (counter, 1000 * counter)


def test_real_time_does_not_lose_time_over_many_short_requests() -> None:
    device, time = switched_on(), Time()
    clock = RealTime(device, 1000, time)
    for _ in range(10_000):
        time.pass_s(0.00033)
        clock.catch_up()
    assert device.sample_counter == 3300


def test_a_command_drives_the_valve_from_the_sample_at_which_it_came() -> None:
    early, late, time = switched_on(), switched_on(), Time()
    clocks = RealTime(early, 1000, time), RealTime(late, 1000, time)
    clocks[0].command(80e3)
    time.pass_s(0.05)
    clocks[1].command(80e3)
    time.pass_s(0.05)
    for clock in clocks:
        clock.catch_up()
    alone = switched_on()
    alone.command(80e3)
    alone.advance(50)
    assert late.position_m == alone.position_m
    assert early.position_m > late.position_m


def test_how_often_it_is_asked_does_not_matter_to_the_valve() -> None:
    often, seldom, time = switched_on(), switched_on(), Time()
    clocks = RealTime(often, 1000, time), RealTime(seldom, 1000, time)
    for clock in clocks:
        clock.command(80e3)
    for _ in range(40):
        time.pass_s(0.001)
        clocks[0].catch_up()
    clocks[1].catch_up()
    assert often.position_m == pytest.approx(seldom.position_m, rel=1e-9)
    assert often.position_m > 0.01


def test_after_a_long_stand_still_the_clock_is_right_and_the_log_says_what_the_valve_missed(
    caplog: pytest.LogCaptureFixture,
) -> None:
    device, time = switched_on(), Time()
    clock = RealTime(device, 1000, time)
    time.pass_s(3600.5)
    with caplog.at_level(logging.WARNING):
        clock.catch_up()
    assert device.device_time_us == 3_600_500_000
    assert caplog.messages == ["stood still: the valve missed 3599.500 s"]

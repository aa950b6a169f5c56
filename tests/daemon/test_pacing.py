"""Absolute deadlines, on a clock of the test's own."""

import pytest

from positioner.daemon import pacing
from positioner.daemon.pacing import DevicePace, RealTimePace


class Clock:
    """A clock that sleeping moves, and that a cycle may move further."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        self.now_s += 1e-7
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(pacing, "time", clock)
    return clock


def test_a_late_cycle_does_not_shift_the_deadlines(clock: Clock) -> None:
    pace = RealTimePace(1e-3)
    pace.wait()
    first_s = clock.now_s
    for busy_s in (0.2e-3, 0.9e-3, 0.0, 0.5e-3):
        clock.now_s += busy_s
        assert pace.wait() == 0
    assert clock.now_s - first_s == pytest.approx(4e-3, abs=2e-6)


def test_missed_periods_are_counted_and_not_made_up_for(clock: Clock) -> None:
    pace = RealTimePace(1e-3)
    pace.wait()
    first_s = clock.now_s
    clock.now_s += 3.5e-3
    assert pace.wait() == 2
    assert clock.now_s - first_s == pytest.approx(3.5e-3, abs=2e-6), "the overdue cycle begins at once"
    assert pace.wait() == 0
    assert clock.now_s - first_s == pytest.approx(4e-3, abs=2e-6), "the next one is back on the grid"


def test_which_command_acts_from_a_sample_on() -> None:
    """In real time the one that travelled with it; in lockstep the device waits for the one decided on it."""
    assert RealTimePace(1e-3).in_force_pa(sent_pa=1.0, decided_pa=2.0) == 1.0
    assert DevicePace().in_force_pa(sent_pa=1.0, decided_pa=2.0) == 2.0


def test_the_devices_clock_is_the_time_in_lockstep() -> None:
    pace = DevicePace()
    assert [pace.now_s(each) for each in (0.5, None, 0.6)] == [0.5, 0.5, 0.6]


def test_a_device_in_lockstep_that_does_not_answer_is_not_asked_without_a_pause(clock: Clock) -> None:
    pace = DevicePace()
    pace.now_s(0.5)
    before_s = clock.now_s
    assert (pace.wait(), clock.now_s) == (0, before_s), "it answers: no pause"
    pace.now_s(None)
    assert (pace.wait(), clock.now_s) == (0, before_s + pacing.SILENCE_S)


def test_with_a_phase_the_deadlines_are_those_of_the_clock(clock: Clock) -> None:
    """So cycles that begin at different times keep their places in the period."""
    pace = RealTimePace(0.25, 0.0625)
    for _ in range(3):
        assert pace.wait() == 0
        assert clock.now_s % 0.25 == pytest.approx(0.0625, abs=2e-6)
        clock.now_s += 0.1
    clock.now_s += 0.45
    assert pace.wait() == 1, "one deadline went by"

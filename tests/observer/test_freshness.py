"""Whether what is shown is of now, in virtual time: every way in which it is not is said within 2 s."""

import math

import pytest

from northbound.observer.freshness import FreshnessMemory, after_failure, after_reading, freshness

SOON_S = 2.0
POLL_S = 0.05


def read(seconds: float, memory: FreshnessMemory | None = None, **values: float) -> FreshnessMemory:
    """Poll a daemon of 1 kHz for some seconds, from time 0 or from the last reading on."""
    memory = memory or FreshnessMemory()
    begin_s, cycles = (0.0, 0.0) if memory.cycles is None else (memory.read_s, memory.cycles)
    for poll in range(1, round(seconds / POLL_S) + 1):
        time_s = begin_s + poll * POLL_S
        said = {"sample_age": 0.0, "period": 1e-3, "cycles": (cycles + 1e3 * poll * POLL_S) % (1 << 32)}
        memory = after_reading(memory, time_s, said | values)
    return memory


def test_what_is_polled_is_live() -> None:
    memory = read(5.0)
    assert freshness(memory, 5.0).measured_live
    assert memory.restarts == 0


def test_nothing_is_live_before_the_first_reading() -> None:
    assert freshness(FreshnessMemory(), 0.0).daemon == "not connected yet"


def test_a_connection_lost_is_stale_at_once_and_says_why() -> None:
    memory = after_failure(read(5.0), 5.1, "no daemon answers there")
    assert freshness(memory, 8.0).daemon == "no connection for 3 s: no daemon answers there"
    assert not freshness(memory, 5.1).live


def test_a_poller_that_says_nothing_is_stale() -> None:
    memory = read(5.0)
    assert freshness(memory, 5.0 + SOON_S).daemon == "the last reading is 2.0 s old"


def test_a_count_of_cycles_that_stands_is_stale() -> None:
    memory = read(SOON_S, read(5.0), cycles=5000.0)
    assert freshness(memory, memory.read_s).daemon == "the daemon's cycle has stood still for 2.0 s"


def test_a_slow_loop_may_take_its_three_periods() -> None:
    memory = read(5.0, read(1.0), cycles=1000.0, period=2.0)
    assert freshness(memory, 6.0).live
    assert not freshness(memory, 7.05).live


def test_an_old_measurement_leaves_what_the_daemon_decides_live() -> None:
    seen = freshness(read(5.0, sample_age=1.5), 5.0)
    assert seen.live
    assert not seen.measured_live
    assert seen.measurement == "the last good measurement is 1.5 s old"


@pytest.mark.parametrize("age_s", [math.nan, math.inf])
def test_a_measurement_that_never_was_is_not_live(age_s: float) -> None:
    assert freshness(read(5.0, sample_age=age_s), 5.0).measurement == "no good measurement yet"


def test_a_count_that_falls_is_a_daemon_started_anew() -> None:
    memory = after_reading(read(5.0), 5.05, {"cycles": 12.0})
    assert memory.restarts == 1
    assert freshness(memory, 5.05).live


def test_a_count_that_wraps_is_none() -> None:
    memory = read(1.0, FreshnessMemory(cycles=2.0**32 - 500.0, read_s=0.0))
    assert memory.restarts == 0
    assert memory.cycles == 500.0


def test_a_young_daemon_started_anew_behind_a_lost_connection_is_told_from_one_that_went_on() -> None:
    """After 1 s of life and 10 s away: one has counted 5 s since it was started, the other all 11 s."""
    memory = after_failure(read(1.0), 1.1, "away")
    assert after_reading(memory, 11.0, {"cycles": 5000.0, "period": 1e-3}).restarts == 1
    assert after_reading(memory, 11.0, {"cycles": 11000.0, "period": 1e-3}).restarts == 0

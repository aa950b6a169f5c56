"""The link: what becomes of readings and of their absence."""

import pytest

from config.codes import Quality
from drivers.boundary import Capabilities, DriverError, NoConnection, NoReply, Reading
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace


class Scripted:
    """A driver that answers from a list; an exception in it is raised."""

    capabilities = Capabilities(one_transaction=True, device_time=True, sample_counter=True)

    def __init__(self, *answers: Reading | DriverError, held_pa: float = 50e3) -> None:
        self.answers = list(answers)
        self.held_pa = held_pa
        self.sent_pa: list[float] = []
        self.opened = 0

    def open(self) -> float:
        self.opened += 1
        return self.held_pa

    def read(self) -> Reading:
        return reading(0)

    def write(self, command_pa: float) -> None:
        self.sent_pa.append(command_pa)

    def exchange(self, command_pa: float) -> Reading:
        self.sent_pa.append(command_pa)
        answer = self.answers.pop(0)
        if isinstance(answer, DriverError):
            raise answer
        return answer

    def close(self) -> None:
        pass


def reading(counter: int, position_m: float = 0.05) -> Reading:
    return Reading(position_m, 50e3, counter, counter * 1e-3, 0)


def opened(driver: Scripted) -> Link:
    link = Link(driver, DevicePace())
    assert link.open() == (driver.held_pa, reading(0))
    return link


def test_a_new_sample_is_good_and_the_same_again_is_repeated() -> None:
    link = opened(Scripted(reading(1), reading(1), reading(2)))
    assert [link.exchange(5e4).quality for _ in range(3)] == [Quality.GOOD, Quality.REPEATED, Quality.GOOD]


@pytest.mark.parametrize(("first", "second", "missed"), [(1, 2, 0), (1, 5, 3), (2**32 - 1, 0, 0), (2**32 - 2, 1, 2)])
def test_missed_samples_are_counted_across_the_counters_wrap(first: int, second: int, missed: int) -> None:
    link = opened(Scripted(reading(first), reading(second)))
    link.exchange(5e4)
    link.exchange(5e4)
    assert link.counts.lost_samples == missed


def test_a_lost_reply_keeps_the_last_values_and_says_so() -> None:
    link = opened(Scripted(reading(1, 0.04), NoReply("silent")))
    link.exchange(5e4)
    lost = link.exchange(5e4)
    assert (lost.quality, lost.position_m, lost.time_s) == (Quality.LOST, 0.04, 1e-3)
    assert link.counts.lost_replies == 1


def test_after_a_loss_it_connects_anew_and_first_gives_the_device_what_it_holds() -> None:
    """A device that was restarted must not be moved by the command it had before."""
    driver = Scripted(reading(1), NoConnection("gone"), reading(1), reading(2), held_pa=0.0)
    link = opened(driver)
    samples = [link.exchange(5e4) for _ in range(4)]
    assert driver.opened == 2
    assert driver.sent_pa == [5e4, 5e4, 0.0, 5e4]
    assert [sample.held_pa for sample in samples] == [None, None, 0.0, None]


def test_the_same_counter_after_a_reconnection_is_a_new_sample() -> None:
    link = opened(Scripted(reading(7), NoReply("silent"), reading(7)))
    assert [link.exchange(5e4).quality for _ in range(3)] == [Quality.GOOD, Quality.LOST, Quality.GOOD]


def test_a_device_without_pressure_and_clock_is_taken_at_its_command_and_the_gateways_time() -> None:
    link = opened(Scripted(Reading(0.05)))
    sample = link.exchange(42e3)
    assert (sample.pressure_pa, sample.quality) == (42e3, Quality.GOOD)

"""The link: what becomes of readings and of their absence."""

from dataclasses import replace
from threading import Event, Thread

import numpy as np
import pytest

from config.codes import Quality
from config.quantities import ActionName, DeviceStatus
from drivers.boundary import Capabilities, DriverError, NoConnection, NoNumber, NoReply, Reading, Refused
from positioner.daemon import link as room
from positioner.daemon.backoff import Doors
from positioner.daemon.link import Link, LinkSettings
from positioner.daemon.pacing import DevicePace


class Scripted:
    """A driver that answers from a list; an exception in it is raised."""

    capabilities = Capabilities(one_transaction=True, device_time=True, sample_counter=True)

    def __init__(self, *answers: Reading | DriverError, held_pa: float = 50e3) -> None:
        self.answers = list(answers)
        self.held_pa = held_pa
        self.sent_pa: list[float] = []
        self.shown: Reading | DriverError = reading(0)
        self.opened = self.closed = 0

    def open(self) -> float:
        self.opened += 1
        return self.held_pa

    def read(self) -> Reading:
        if isinstance(self.shown, DriverError):
            raise self.shown
        return self.shown

    def write(self, command_pa: float) -> None:
        self.sent_pa.append(command_pa)

    def exchange(self, command_pa: float) -> Reading:
        self.sent_pa.append(command_pa)
        answer = self.answers.pop(0)
        if isinstance(answer, DriverError):
            raise answer
        return answer

    def close(self) -> None:
        self.closed += 1


def reading(counter: int, position_m: float = 0.05) -> Reading:
    return Reading(position_m, 50e3, counter, counter * 1e-3, 0)


def opened(driver: Scripted, shown: Reading | None = None) -> Link:
    link = Link(driver, DevicePace())
    assert link.open() == (driver.held_pa, shown or reading(0))
    return link


def test_a_new_sample_is_good_and_the_same_again_is_repeated() -> None:
    link = opened(Scripted(reading(1), reading(1), reading(2)))
    assert [link.exchange(5e4).quality for _ in range(3)] == [Quality.GOOD, Quality.REPEATED, Quality.GOOD]


@pytest.mark.parametrize(
    ("bits", "first", "second", "missed"),
    [(32, 1, 2, 0), (32, 1, 5, 3), (32, 2**32 - 1, 0, 0), (32, 2**32 - 2, 1, 2), (16, 65535, 0, 0), (8, 254, 1, 2)],
)
def test_missed_samples_are_counted_across_the_counters_wrap(bits: int, first: int, second: int, missed: int) -> None:
    driver = Scripted(*(Reading(0.05, 50e3, counter) for counter in (first, second)))
    driver.capabilities = replace(driver.capabilities, counter_range=1 << bits)
    link = opened(driver)
    link.exchange(5e4)
    link.exchange(5e4)
    assert link.counts.lost_samples == missed


def test_a_lost_reply_keeps_the_last_values_and_says_so() -> None:
    link = opened(Scripted(reading(1, 0.04), NoReply("silent")))
    link.exchange(5e4)
    lost = link.exchange(5e4)
    assert (lost.quality, lost.position_m, lost.time_s) == (Quality.LOST, 0.04, 1e-3)
    assert link.counts.lost_replies == 1


def test_a_device_that_comes_back_without_a_number_is_no_silent_one_between_attempts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The fault changed with every attempt, some four times a second, and the journal with it."""
    driver = Scripted(reading(1), NoConnection("gone"))
    link, now_s = opened(driver), room.awake_s()
    driver.shown = NoNumber("nan")
    monkeypatch.setattr(room, "awake_s", lambda: now_s)
    assert [link.exchange(5e4).quality for _ in range(9)] == [Quality.GOOD, Quality.LOST, *7 * (Quality.NO_NUMBER,)]
    assert driver.opened < 7, "it is not asked in each cycle"


@pytest.mark.parametrize(("lost", "begins"), [(2, True), (3, False)])
def test_a_reply_lost_at_the_start_is_asked_for_again(lost: int, begins: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    driver = Scripted()
    readings: list[Reading | None] = [None] * lost + [reading(1)]

    def read() -> Reading:
        if (answer := readings.pop(0)) is None:
            raise NoReply("silent")
        return answer

    monkeypatch.setattr(driver, "read", read)
    link = Link(driver, DevicePace())
    if begins:
        assert link.open() == (driver.held_pa, reading(1))
        assert (driver.opened, driver.closed) == (3, 2)
    else:
        with pytest.raises(NoReply):
            link.open()
    assert driver.sent_pa == [], "nothing is commanded at the start"


def test_after_a_loss_it_connects_anew_and_looks_before_it_commands() -> None:
    """A device that was restarted must not be moved by the command it had before, nor its status be cleared by it."""
    driver = Scripted(reading(1), NoConnection("gone"), reading(2), held_pa=0.0)
    driver.shown = reading(9)._replace(status=DeviceStatus.COMMUNICATION_LOST)
    link = opened(driver, driver.shown)
    samples = [link.exchange(5e4) for _ in range(4)]
    assert driver.opened == 2
    assert driver.sent_pa == [5e4, 5e4, 5e4]
    assert [sample.held_pa for sample in samples] == [None, None, 0.0, None]
    assert samples[2].status == DeviceStatus.COMMUNICATION_LOST


BY_ITSELF = LinkSettings(vented_pa=20e3, filled_pa=140e3)


@pytest.mark.parametrize(
    ("shown_pa", "told", "in_force_pa"),
    [
        (1e3, "vent", 20e3),
        (1e3, "hold", 20e3),
        (59e3, "vent", 60e3),
        (250e3, "fill", 140e3),
        (None, "vent", 20e3),
        (None, "fill", 140e3),
        (None, "hold", 60e3),
        (None, None, 60e3),
    ],
)
def test_a_device_that_has_vented_or_filled_by_itself_and_kept_its_set_point_is_held_as_it_is(
    shown_pa: float | None, told: ActionName | None, in_force_pa: float
) -> None:
    """Else it would obey its set point again with the first command: a valve that moves at start or reconnection."""
    driver = Scripted(NoConnection("gone"), held_pa=60e3)
    driver.shown = reading(1)._replace(pressure_pa=shown_pa, status=DeviceStatus.COMMUNICATION_LOST)
    link = Link(driver, DevicePace(), replace(BY_ITSELF, acts_alone_by=told))
    assert link.open()[0] == in_force_pa
    link.exchange(60e3)
    assert link.exchange(60e3).held_pa == in_force_pa


@pytest.mark.parametrize(("shown_pa", "in_force_pa"), [(85e3, 85e3), (1e3, 20e3), (250e3, 140e3), (None, 60e3)])
def test_a_device_that_is_operated_locally_is_held_where_it_is(shown_pa: float | None, in_force_pa: float) -> None:
    """Its set point is of before: given back, it would go there."""
    driver = Scripted(held_pa=60e3)
    driver.shown = reading(1)._replace(pressure_pa=shown_pa, status=DeviceStatus.NOT_READY)
    assert Link(driver, DevicePace(), BY_ITSELF).open()[0] == in_force_pa


def test_a_device_that_obeys_is_held_at_its_set_point_whatever_pressure_it_shows() -> None:
    driver = Scripted(held_pa=60e3)
    driver.shown = reading(1)._replace(pressure_pa=1e3)
    assert Link(driver, DevicePace(), BY_ITSELF).open()[0] == 60e3


def test_the_same_sample_after_a_reconnection_is_repeated_and_the_next_is_new_whatever_its_counter() -> None:
    driver = Scripted(reading(7), NoReply("silent"), reading(7))
    link = opened(driver)
    driver.shown = reading(7)
    expected = [Quality.GOOD, Quality.LOST, Quality.REPEATED, Quality.REPEATED]
    assert [link.exchange(5e4).quality for _ in range(4)] == expected
    driver = Scripted(reading(7), NoReply("silent"), reading(1))
    link = opened(driver)
    assert [link.exchange(5e4).quality for _ in range(4)] == [Quality.GOOD, Quality.LOST, Quality.GOOD, Quality.GOOD]
    assert link.counts.lost_samples == 0


@pytest.mark.parametrize(("holds", "sent_pa"), [(True, [5e4]), (False, [5e4, 0.0])])
def test_a_device_that_is_lost_at_the_end_is_not_commanded_to_hold_what_it_may_not_have(
    holds: bool, sent_pa: list[float]
) -> None:
    """It may have been restarted: the old command would move it, and nobody would see it."""
    driver = Scripted(NoReply("away"), held_pa=0.0)
    link = opened(driver)
    link.exchange(5e4)
    link.leave(5e4 if holds else 0.0, holds=holds)
    assert driver.sent_pa == sent_pa


class Stopwatch:
    """The gateway's clock, moved by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 1000.0
        monkeypatch.setattr(room, "awake_s", lambda: self.now_s)


def test_a_daemon_that_stood_still_looks_at_the_device_before_it_commands_it(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    clock = Stopwatch(monkeypatch)
    driver = Scripted(reading(1), reading(2), reading(4), held_pa=0.0)
    link = Link(driver, DevicePace(), LinkSettings(longest_unattended_s=0.5))
    link.open()
    link.begin()
    samples = [link.exchange(5e4)]
    clock.now_s += 0.4
    samples.append(link.exchange(5e4))
    clock.now_s += 0.6
    driver.shown = reading(3)._replace(status=DeviceStatus.COMMUNICATION_LOST)
    samples.append(link.exchange(5e4))
    assert driver.sent_pa == [5e4, 5e4], "nothing was commanded"
    samples.append(link.exchange(0.0))
    assert [sample.unattended_s for sample in samples] == [0.0, 0.0, pytest.approx(0.6), 0.0]
    assert (samples[2].held_pa, samples[2].status) == (0.0, DeviceStatus.COMMUNICATION_LOST)
    assert "the daemon stood still" in caplog.text


@pytest.mark.parametrize("setting_up_s", [0.3, 0.49, 0.7])
def test_a_set_up_that_took_long_is_no_stall_but_the_device_is_looked_at_before_it_is_commanded_again(
    setting_up_s: float, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """One that took a little less than is allowed is more than that by the first cycle."""
    clock = Stopwatch(monkeypatch)
    driver = Scripted(reading(1), reading(3), reading(5), held_pa=0.0)
    link = Link(driver, DevicePace(), LinkSettings(longest_unattended_s=0.5))
    link.open()
    link.exchange(5e4)
    clock.now_s += setting_up_s
    link.begin()
    clock.now_s += 0.1
    driver.shown = reading(2)
    sample = link.exchange(5e4)
    too_long = setting_up_s + 0.1 > 0.5
    assert (sample.quality, sample.unattended_s) == (Quality.GOOD, 0.0)
    assert sample.held_pa == (0.0 if too_long else None), "what it holds tells whether it acted by itself"
    assert driver.sent_pa == ([5e4] if too_long else [5e4, 5e4])
    assert "the daemon stood still" not in caplog.text
    link.exchange(0.0)
    clock.now_s += 0.6
    assert link.exchange(0.0).unattended_s == pytest.approx(0.6), "from then on a stall is one"


def test_a_daemon_that_stood_still_before_its_first_cycle_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Stopwatch(monkeypatch)
    link = Link(Scripted(reading(1)), DevicePace(), LinkSettings(longest_unattended_s=0.5))
    link.open()
    link.exchange(5e4)
    link.begin()
    clock.now_s += 0.6
    assert link.exchange(5e4).unattended_s == pytest.approx(0.6)


class Waiting(Scripted):
    """A driver that connects when it is let."""

    def __init__(self, *answers: Reading | DriverError) -> None:
        super().__init__(*answers)
        self.asked, self.let = Event(), Event()

    def open(self) -> float:
        self.asked.set()
        assert self.let.wait(60.0)
        return super().open()


def test_so_many_connect_at_a_time_and_the_others_with_a_later_cycle() -> None:
    doors = Doors(2)
    drivers = [Waiting(reading(1)) for _ in range(5)]
    links = [Link(driver, DevicePace(), doors=doors) for driver in drivers]
    first = [Thread(target=link.exchange, args=(5e4,)) for link in links[:2]]
    for thread, driver in zip(first, drivers, strict=False):
        thread.start()
        assert driver.asked.wait(60.0)
    for driver in drivers[2:]:
        driver.let.set()
    assert [link.exchange(5e4).quality for link in links[2:]] == [Quality.LOST] * 3
    for driver in drivers[:2]:
        driver.let.set()
    for thread in first:
        thread.join()
    assert [link.exchange(5e4).quality for link in links[2:]] == [Quality.GOOD] * 3
    assert [driver.opened for driver in drivers] == [1] * 5


def test_who_lost_one_reply_does_not_wait_behind_those_that_are_away() -> None:
    doors = Doors(1)
    away = Waiting()
    thread = Thread(target=Link(away, DevicePace(), doors=doors).exchange, args=(5e4,))
    link = Link(Scripted(NoReply("lost"), reading(2)), DevicePace(), doors=doors)
    link.open()
    thread.start()
    assert away.asked.wait(60.0)
    qualities = [link.exchange(5e4).quality for _ in range(2)]
    away.let.set()
    thread.join()
    assert qualities == [Quality.LOST, Quality.GOOD]


def test_a_stall_is_told_even_where_the_device_is_found_only_later(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = Stopwatch(monkeypatch)
    driver = Scripted(reading(1), reading(4))
    link = Link(driver, DevicePace(), LinkSettings(longest_unattended_s=0.5))
    link.open()
    link.exchange(5e4)
    clock.now_s += 0.6
    driver.shown = NoReply("silent")
    assert link.exchange(5e4).quality is Quality.LOST
    driver.shown = reading(3)
    assert link.exchange(5e4).unattended_s == pytest.approx(0.6)


def test_a_device_that_is_away_is_asked_ever_more_seldom_and_each_kind_said_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A minute of cycles of 1 ms; it comes for one reply every 50th time it is asked."""
    clock = Stopwatch(monkeypatch)
    driver = Scripted(reading(1))
    link = opened(driver)
    link.exchange(5e4)
    for attempt in range(60_000):
        gone = driver.opened % 50 != 0
        driver.shown = NoReply(f"silent {attempt}") if gone else reading(2)
        driver.answers = [NoReply(f"silent again {attempt}")]
        link.exchange(5e4)
        clock.now_s += 1e-3
    assert 60 < driver.opened < 100
    assert len(caplog.records) < 10
    driver.shown, driver.answers = reading(2), [reading(number) for number in range(3, 30_003)]
    for _ in range(2_000):
        link.exchange(5e4)
        clock.now_s += 1e-3
    driver.answers.insert(0, NoReply("silent"))
    qualities = [link.exchange(5e4).quality for _ in range(3)]
    assert qualities[0] is Quality.LOST
    assert qualities[2] is Quality.GOOD, "after a while that went well it is asked again at once"


def test_a_line_that_loses_one_reply_in_thirty_loses_no_more_by_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long it goes on: what is lost now and then is no device that is away."""
    clock = Stopwatch(monkeypatch)
    rng = np.random.default_rng(1)
    lost = (rng.random(10_000) < 1 / 30).tolist()
    answers = [NoReply("lost") if gone else reading(number) for number, gone in enumerate(lost, 2)]
    link = opened(Scripted(reading(1), *answers))
    in_a_row = longest = 0
    for _ in range(8_000):
        in_a_row = in_a_row + 1 if link.exchange(5e4).quality is Quality.LOST else 0
        longest = max(longest, in_a_row)
        clock.now_s += 1e-3
    assert longest <= 3, "as many as happen to be lost one after another"


def test_a_device_that_is_back_has_its_next_lost_reply_asked_for_again_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """However long it was away: one lost reply is no fault."""
    clock = Stopwatch(monkeypatch)
    driver = Scripted(reading(1), *(NoReply("away") for _ in range(200)))
    link = opened(driver)
    driver.shown = NoReply("away")
    for _ in range(5_000):
        link.exchange(5e4)
        clock.now_s += 1e-3
    clock.now_s += 1.0
    driver.shown, driver.answers = reading(2), [reading(3), NoReply("lost"), reading(4)]
    qualities = []
    for _ in range(4):
        qualities.append(link.exchange(5e4).quality)
        clock.now_s += 10e-3
    assert qualities == [Quality.GOOD, Quality.GOOD, Quality.LOST, Quality.GOOD], "found again at once"


@pytest.mark.parametrize(
    ("error", "quality"), [(Refused("exception 6", 6), Quality.LOST), (NoNumber("nan"), Quality.NO_NUMBER)]
)
def test_an_exception_or_a_number_that_is_none_keeps_the_connection(error: DriverError, quality: Quality) -> None:
    driver = Scripted(reading(1), error, reading(2), error, error, reading(3))
    link = opened(driver)
    expected = [Quality.GOOD, quality, Quality.GOOD, quality, quality, Quality.GOOD]
    assert [link.exchange(5e4).quality for _ in range(6)] == expected
    assert (driver.opened, driver.closed) == (1, 0)


def test_a_device_that_goes_on_refusing_is_looked_at_anew() -> None:
    refusals = [Refused("exception 4", 4)] * 3
    driver = Scripted(reading(1), *refusals, held_pa=0.0)
    link = opened(driver)
    assert [link.exchange(5e4).held_pa for _ in range(5)] == [None] * 4 + [0.0]


def test_a_device_without_pressure_and_clock_is_taken_at_its_command_and_the_gateways_time() -> None:
    link = opened(Scripted(Reading(0.05)))
    sample = link.exchange(42e3)
    assert (sample.pressure_pa, sample.quality) == (42e3, Quality.GOOD)


def test_pressures_of_after_the_command_are_taken_a_sample_late() -> None:
    """The pressure of a sample is that which acted since the sample before."""
    shown = [Reading(0.05, pressure_pa, counter) for counter, pressure_pa in enumerate((40e3, 60e3, 60e3, 80e3))]
    for is_after, expected in ((False, [40e3, 60e3, 60e3, 80e3]), (True, [40e3, 40e3, 60e3, 60e3])):
        link = Link(Scripted(*shown), DevicePace(), LinkSettings(pressure_is_after=is_after))
        link.open()
        assert [link.exchange(5e4).pressure_pa for _ in shown] == expected


def test_a_device_that_shows_no_pressure_has_had_the_command_before_unless_it_is_in_lockstep() -> None:
    for in_lockstep, expected in ((True, [1e3, 2e3, 3e3]), (False, [1e3, 1e3, 2e3])):
        link = Link(Scripted(*[Reading(0.05)] * 3), DevicePace(), LinkSettings(in_lockstep=in_lockstep))
        link.open()
        assert [link.exchange(pressure_pa).pressure_pa for pressure_pa in (1e3, 2e3, 3e3)] == expected


def test_a_device_that_begins_anew_on_a_good_connection_is_looked_at_before_it_is_commanded() -> None:
    """Its clock or its counter says so; it is no loss of four thousand million samples."""
    driver = Scripted(reading(5), reading(0), reading(2), held_pa=0.0)
    link = opened(driver)
    driver.shown = reading(1)
    samples = [link.exchange(5e4) for _ in range(3)]
    assert [sample.quality for sample in samples] == [Quality.GOOD, Quality.LOST, Quality.GOOD]
    assert [sample.held_pa for sample in samples] == [None, None, 0.0]
    assert driver.sent_pa == [5e4, 5e4]
    assert link.counts.lost_samples == 0

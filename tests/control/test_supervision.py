"""Faults: what raises them, that they latch, and what frees them."""

import math
from dataclasses import replace

import pytest

from config.codes import Fault, Mode, Quality
from config.daemon_file import DaemonFile
from config.quantities import DeviceStatus
from positioner.control.requests import Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.control.supervision import Limits, SupervisionMemory, supervise, usable

LIMITS = Limits(
    stroke_m=0.1,
    travel_margin=0.1,
    lost_after_cycles=3,
    stale_after_s=0.1,
    heartbeat_timeout_s=1.0,
    restart_tolerance_pa=400.0,
    action="vent",
    heartbeat_action="hold",
)
PERIOD_S = 0.01


def good(now_s: float, position_m: float = 0.05) -> Sample:
    return Sample(now_s, now_s, position_m, 50e3)


def watched(
    samples: list[Sample], requests: Requests, memory: SupervisionMemory | None = None
) -> list[SupervisionMemory]:
    """Return the watch after each sample."""
    watches = [memory or SupervisionMemory()]
    for sample in samples:
        watches.append(supervise(watches[-1], sample, 50e3, requests, LIMITS, good=usable(sample, LIMITS)))
    return watches[1:]


def faults(watches: list[SupervisionMemory]) -> list[Fault]:
    return [memory.fault for memory in watches]


AUTOMATIC = Requests(mode=Mode.AUTOMATIC, mode_writes=1)


def test_good_samples_raise_nothing_and_the_mode_is_taken_up() -> None:
    watches = watched([good(0.0), good(0.01)], AUTOMATIC)
    assert faults(watches) == [Fault.NONE] * 2
    assert watches[-1].mode is Mode.AUTOMATIC


def test_the_third_lost_reply_in_a_row_is_a_fault_and_the_mode_falls() -> None:
    lost = [good(0.01 * n)._replace(quality=Quality.LOST) for n in range(1, 4)]
    watches = watched([good(0.0), *lost], AUTOMATIC)
    assert faults(watches) == [Fault.NONE, Fault.NONE, Fault.NONE, Fault.NO_REPLY]
    assert watches[-1].mode is Mode.HOLD


def test_a_dead_line_that_is_slower_than_staleness_is_no_reply() -> None:
    lost = [good(0.0)._replace(now_s=2.0 * n, quality=Quality.LOST) for n in range(1, 3)]
    assert faults(watched([good(0.0), *lost], AUTOMATIC))[1] is Fault.NO_REPLY


def test_two_lost_replies_with_a_good_one_between_are_none() -> None:
    lost = good(0.01)._replace(quality=Quality.LOST)
    assert faults(watched([good(0.0), lost, lost, good(0.03), lost, lost], AUTOMATIC)) == [Fault.NONE] * 6


@pytest.mark.parametrize("period_s", [1e-3, 0.05, 0.1, 0.4])
@pytest.mark.parametrize("quality", [Quality.LOST, Quality.REPEATED])
def test_by_a_file_that_says_nothing_of_it_a_reply_or_two_that_are_lost_are_no_fault(
    quality: Quality, period_s: float
) -> None:
    """At 100 ms the first one was: it was longer ago than 0.1 s."""
    tables = {"valve": {"stroke_m": 0.1}, "cycle": {"period_s": period_s}}
    limits = Settings.of(DaemonFile.model_validate(tables)).limits
    memory = SupervisionMemory()
    for n, each in enumerate((Quality.GOOD, quality, quality, Quality.GOOD, quality, quality)):
        sample = good(1.001 * period_s * n)._replace(quality=each)
        memory = supervise(memory, sample, 50e3, AUTOMATIC, limits, good=usable(sample, limits))
        assert memory.fault is Fault.NONE
    third = good(period_s * 7 + 0.11)._replace(quality=quality)
    assert supervise(memory, third, 50e3, AUTOMATIC, limits, good=False).fault is not Fault.NONE


def test_repeated_samples_turn_stale() -> None:
    repeated = [good(0.0)._replace(now_s=0.03 * n, quality=Quality.REPEATED) for n in range(1, 5)]
    assert faults(watched([good(0.0), *repeated], AUTOMATIC))[-2:] == [Fault.NONE, Fault.STALE]


@pytest.mark.parametrize("position_m", [-0.011, 0.111, math.nan, math.inf, 3e38])
def test_an_impossible_position_counts_as_no_measurement(position_m: float) -> None:
    bad = [good(0.01 * n, position_m) for n in range(1, 4)]
    assert faults(watched([good(0.0), *bad], AUTOMATIC))[-2:] == [Fault.NONE, Fault.IMPLAUSIBLE]


@pytest.mark.parametrize("status", list(DeviceStatus))
def test_an_unfit_device_is_a_fault_at_once(status: DeviceStatus) -> None:
    alone = status is DeviceStatus.COMMUNICATION_LOST
    expected = Fault.COMMUNICATION_LOST if alone else Fault.DEVICE
    assert faults(watched([good(0.0)._replace(status=status)], AUTOMATIC)) == [expected]


def test_a_device_that_is_unfit_and_was_alone_is_unfit() -> None:
    both = DeviceStatus.COMMUNICATION_LOST | DeviceStatus.SENSOR_FAULT
    assert faults(watched([good(0.0)._replace(status=both)], AUTOMATIC)) == [Fault.DEVICE]


@pytest.mark.parametrize(("held_pa", "fault"), [(50e3, Fault.NONE), (50.3e3, Fault.NONE), (0.0, Fault.RESTARTED)])
def test_a_device_that_comes_back_with_another_command_was_restarted(held_pa: float, fault: Fault) -> None:
    assert faults(watched([good(0.0), good(0.01)._replace(held_pa=held_pa)], AUTOMATIC)) == [Fault.NONE, fault]


def test_a_device_that_has_not_answered_yet_is_a_fault_while_that_lasts_and_leaves_none_behind() -> None:
    """It is found with another command than was assumed: nobody has given it one."""
    silent = [good(0.0)._replace(now_s=0.04 * n, quality=Quality.LOST) for n in range(5)]
    found = good(0.2)._replace(held_pa=0.0)
    watches = watched([*silent, found, *[each._replace(now_s=each.now_s + 0.24) for each in silent]], AUTOMATIC)
    assert faults(watches)[2:6] == [Fault.NO_REPLY] * 3 + [Fault.NONE]
    assert watches[5].mode is Mode.HOLD, "whoever chose a mode meanwhile chooses it again"
    assert faults(watched([good(0.5)], AUTOMATIC, watches[-1])) == [Fault.NO_REPLY], "from then on silence is latched"


def test_what_was_seen_in_the_set_up_is_no_measurement_of_the_cycles() -> None:
    """The set-up took ten seconds, and the device waits for its turn to be found."""
    (set_up,) = watched([good(0.0)], Requests())
    waits = [good(0.0)._replace(now_s=10.0 + 0.03 * n, quality=Quality.LOST) for n in range(4)]
    found = good(10.2)._replace(held_pa=0.0)
    watches = watched([*waits, found], Requests(), set_up.begun())
    assert faults(watches) == [Fault.NONE, Fault.NONE, Fault.NO_REPLY, Fault.NO_REPLY, Fault.NONE]


def test_a_daemon_that_stood_still_is_a_fault_whatever_the_device_says() -> None:
    late = good(0.01)._replace(unattended_s=2.0, held_pa=0.0, status=DeviceStatus.COMMUNICATION_LOST)
    watches = watched([good(0.0), late], AUTOMATIC)
    assert faults(watches) == [Fault.NONE, Fault.STALLED]
    assert watches[-1].mode is Mode.HOLD


def test_a_measurement_that_is_no_number_is_implausible() -> None:
    none = [good(0.01 * n)._replace(quality=Quality.NO_NUMBER) for n in range(1, 4)]
    assert faults(watched([good(0.0), *none], AUTOMATIC))[-2:] == [Fault.NONE, Fault.IMPLAUSIBLE]


def after_a_new_command(lost: int) -> Fault:
    """Return the fault after replies were lost from a new command on, and the device comes back with the one before."""
    memory = supervise(SupervisionMemory(), good(0.0), 50e3, AUTOMATIC, LIMITS, good=True)
    for n in range(1, lost + 1):
        lost_reply = good(0.0)._replace(now_s=PERIOD_S * n, quality=Quality.LOST)
        memory = supervise(memory, lost_reply, 60e3, AUTOMATIC, LIMITS, good=False)
    back = good(PERIOD_S * (lost + 1))._replace(held_pa=50e3)
    return supervise(memory, back, 60e3, AUTOMATIC, LIMITS, good=True).fault


def test_a_device_that_has_not_got_the_last_command_was_not_restarted() -> None:
    assert after_a_new_command(lost=1) is Fault.NONE
    assert after_a_new_command(lost=2) is Fault.NONE


def test_a_device_that_was_away_for_longer_was() -> None:
    assert after_a_new_command(lost=3) is Fault.RESTARTED


def test_a_fault_stays_until_acknowledged_after_its_cause_is_gone() -> None:
    unfit = good(0.0)._replace(status=DeviceStatus.NOT_READY)
    acknowledged = replace(AUTOMATIC, acknowledgements=1)
    early = watched([unfit, unfit._replace(now_s=0.01)], acknowledged)
    assert faults(early) == [Fault.DEVICE, Fault.DEVICE]
    late = watched([good(0.02)], acknowledged, early[-1])
    assert faults(late) == [Fault.DEVICE], "one acknowledgement is used up once"
    again = watched([good(0.03)], replace(acknowledged, acknowledgements=2), late[-1])
    assert faults(again) == [Fault.NONE]
    assert again[-1].mode is Mode.HOLD, "the mode asked for before the fault does not come back"


def test_a_mode_asked_for_during_a_fault_is_not_taken_up_later() -> None:
    unfit = good(0.0)._replace(status=DeviceStatus.NOT_READY)
    memory = watched([unfit], AUTOMATIC)[-1]
    memory = watched([good(0.01)], replace(AUTOMATIC, mode_writes=2), memory)[-1]
    memory = watched([good(0.02)], replace(AUTOMATIC, mode_writes=2, acknowledgements=1), memory)[-1]
    assert (memory.fault, memory.mode) == (Fault.NONE, Mode.HOLD)


def test_a_silent_dcs_is_a_fault_only_while_something_other_than_hold_is_on() -> None:
    quiet = [good(0.5 * n) for n in range(5)]
    limits_kept = watched(quiet, Requests())
    assert faults(limits_kept) == [Fault.NONE] * 5
    assert faults(watched(quiet, AUTOMATIC)) == [Fault.NONE] * 3 + [Fault.DCS_SILENT] * 2


def test_each_fault_has_its_action() -> None:
    assert LIMITS.action_on(Fault.DCS_SILENT) == "hold"
    assert LIMITS.action_on(Fault.NO_REPLY) == "vent"


def test_a_reply_that_is_lost_while_the_sensor_says_nonsense_is_no_silence_of_the_device() -> None:
    """Each has an action of its own, and one reply lost is no fault."""
    nonsense = [good(PERIOD_S * n, position_m=9.0) for n in range(1, 5)]
    lost = [good(PERIOD_S * n)._replace(quality=Quality.LOST) for n in range(5, 8)]
    found = faults(watched([good(0.0), *nonsense, *lost], AUTOMATIC))
    assert found[3:] == [*[Fault.IMPLAUSIBLE] * 4, Fault.NO_REPLY], "three in a row are one"

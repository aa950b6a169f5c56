"""`doctor --nudge-pa`: how long it waits for the change to show, and that the command is put back whatever happens.

And what a lost reply is to it.
"""

from pathlib import Path

import pytest

from config.daemon_file import DaemonFile
from config.errors import CommandFailed
from drivers.boundary import Capabilities, NoConnection, NoReply, Reading
from positioner.cli import doctor, probe
from positioner.cli.parts import sampling_order
from positioner.cli.parts.sampling_order import SETTLE, Shown, when_shown

HELD_PA, NUDGE_PA = 50e3, 500.0


class Slow:
    """A driver of a device whose pressure shows a command after so many replies; one of them may fail."""

    def __init__(self, shows_after: int, fails_at: int = -1, stays_lost: bool = False) -> None:
        self.shows_after, self.fails_at, self.stays_lost = shows_after, fails_at, stays_lost
        self.replies = self.nudged = 0
        self.command_pa, self.is_open = HELD_PA, True

    def open(self) -> float:
        if self.stays_lost:
            raise NoConnection("nobody is there any more")
        self.is_open = True
        return self.command_pa

    def close(self) -> None:
        self.is_open = False

    def write(self, command_pa: float) -> None:
        if not self.is_open:
            raise NoConnection("the driver is not open")
        self.command_pa = command_pa

    def exchange(self, command_pa: float) -> Reading:
        self.replies += 1
        if self.replies == self.fails_at:
            self.close()
            raise NoReply("no reply within 50 ms")
        self.write(command_pa)
        self.nudged += command_pa != HELD_PA
        return Reading(0.05, HELD_PA + (NUDGE_PA if self.nudged > self.shows_after else 0.0))


def test_a_slow_converter_is_waited_for_however_often_the_device_answers() -> None:
    """After 200 replies, which at 1 kHz is 0.2 s, it said that the pressure does not show the change."""
    driver = Slow(5000)
    assert when_shown(driver, HELD_PA, NUDGE_PA) == Shown("before", 5000)  # type: ignore[arg-type]
    assert driver.command_pa == HELD_PA


def test_it_waits_for_no_longer_than_it_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sampling_order, "WITHIN_S", 0.0)
    driver = Slow(5000)
    with pytest.raises(CommandFailed, match="does not show a change of 500 Pa within 0 s"):
        when_shown(driver, HELD_PA, NUDGE_PA)  # type: ignore[arg-type]
    assert driver.command_pa == HELD_PA


def test_a_command_is_put_back_on_another_connection_and_the_first_error_is_said() -> None:
    driver = Slow(5000, fails_at=SETTLE + 3)
    with pytest.raises(NoReply, match=r"^no reply within 50 ms$"):
        when_shown(driver, HELD_PA, NUDGE_PA)  # type: ignore[arg-type]
    assert driver.command_pa == HELD_PA


def test_what_hinders_the_clean_up_does_not_hide_the_first_error() -> None:
    driver = Slow(5000, fails_at=SETTLE + 3, stays_lost=True)
    with pytest.raises(CommandFailed) as caught:
        when_shown(driver, HELD_PA, NUDGE_PA)  # type: ignore[arg-type]
    assert str(caught.value) == (
        "no reply within 50 ms; and the command could not be put back to 50000 Pa: nobody is there any more"
    )


class Lossy(Slow):
    """A driver that loses so many replies to readings, one in a row."""

    capabilities = Capabilities(one_transaction=True, device_time=False, sample_counter=False)

    def __init__(self, loses: int) -> None:
        super().__init__(0)
        self.loses = loses

    def read(self) -> Reading:
        if not self.is_open:
            raise NoConnection("the driver is not open")
        self.replies += 1
        if self.loses and self.replies % 2 == 0:
            self.loses -= 1
            self.close()
            raise NoReply("no reply within 50 ms")
        return Reading(0.05, HELD_PA)


@pytest.mark.parametrize(
    ("loses", "said"), [(0, "a reading"), (1, "its reply was lost"), (2, "2 of 100 readings had no")]
)
def test_one_lost_reply_fails_no_device_and_more_are_said(
    loses: int, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The daemon asks again, too; `run` began with a device of which `doctor` said that it is not there."""
    file = DaemonFile.model_validate({"valve": {"stroke_m": 0.1}, "cycle": {"period_s": 0.5}})
    monkeypatch.setattr(probe, "watching_driver", lambda _file: Lossy(loses))
    try:
        found = doctor.check_bus(file, Path())
    except doctor.FailedCheck as failed:
        found = str(failed)
        assert loses > 1
    assert said in found

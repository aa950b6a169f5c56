"""What an operator may do, and that it is confirmed by what the daemon reads back; the daemon is a scripted one."""

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from threading import Event, Thread
from typing import Any, cast

import pytest

from config.codes import Fault, Mode
from config.roles import Role
from northbound.observer.freshness import Freshness
from northbound.observer.valve_commands import BrokenOff, Confirmation, ValveCommands
from northbound.observer.valve_view import ValvePicture
from positioner.dcs import Dcs, DcsError
from tests.observer.test_register_words import READY


class Daemon:
    """Takes what is written, save what it is told to leave as it is."""

    def __init__(self) -> None:
        self.values: dict[str, float] = {**READY, "reference": 0.5}
        self.leaves: set[str] = set()
        self.writes: list[tuple[Role, str, float]] = []
        self.picture = ValvePicture("FV-101", 0.0, Freshness(), self.values, 0, ())
        self.commands = ValveCommands(self._connect, lambda: self.picture)
        self.break_off_after = -1.0
        self.away = False

    def _connect(self, role: Role) -> Dcs:
        if self.away:
            raise DcsError("no daemon answers there")
        return cast("Dcs", Line(self, role))


class Line:
    def __init__(self, daemon: Daemon, role: Role) -> None:
        self._daemon, self._role = daemon, role

    def __enter__(self) -> "Line":
        return self

    def __exit__(self, *_: Any) -> None: ...

    def set_and_read_back(self, name: str, value: float) -> float:
        self._daemon.writes.append((self._role, name, value))
        if name not in self._daemon.leaves:
            self._daemon.values[name] = value
        return self._daemon.values[name]

    def get(self, name: str) -> float:
        return self._daemon.values[name]

    def get_all(self, *names: str) -> dict[str, float]:
        return {name: self._daemon.values[name] for name in names}

    def identify(self, excitation: Mapping[str, float], timeout_s: float, show: Callable[[float], None]) -> str | None:
        for progress in (0.0, 0.5, 1.0):
            if progress == self._daemon.break_off_after:
                self._daemon.commands.break_off()
            show(progress)
        return None


@pytest.fixture
def daemon() -> Daemon:
    return Daemon()


def test_a_write_is_confirmed_by_what_reads_back(daemon: Daemon) -> None:
    assert daemon.commands.set_reference(Role.OPERATOR, 0.25) == Confirmation(True, "reference is 25 %, as read back")
    assert daemon.commands.set_mode(Role.ENGINEER, Mode.HOLD) == Confirmation(True, "mode is hold, as read back")
    assert daemon.writes == [(Role.OPERATOR, "reference", 0.25), (Role.ENGINEER, "mode", Mode.HOLD)]


def test_a_position_that_is_not_allowed_is_refused_in_what_it_was_typed_in(daemon: Daemon) -> None:
    said = Confirmation(False, "reference: allowed is 0 to 100 %, got 150 %")
    assert daemon.commands.set_reference(Role.OPERATOR, 1.5) == said
    assert daemon.writes == []


HELD = {
    "mode": Mode.HOLD,
    "reference": 0.7,
    "position_signal": 0.2,
    "reference_opening": 0.9,
    "reference_in_force": 0.1,
}


def test_automatic_goes_where_was_agreed_to_or_stays_where_the_stem_is(daemon: Daemon) -> None:
    for waits, goes, there in ((0.4, True, 0.7), (0.4, False, 0.2), (None, False, 0.2)):
        asked = 0.1 if waits is None else waits
        daemon.values |= HELD | {"reference_opening": asked}
        daemon.writes.clear()
        assert daemon.commands.automatic(Role.ENGINEER, waits, goes=goes).done
        assert daemon.writes == [(Role.ENGINEER, "reference", there), (Role.ENGINEER, "mode", Mode.AUTOMATIC)]


def test_a_reference_that_has_changed_since_the_question_moves_nothing(daemon: Daemon) -> None:
    daemon.values |= HELD
    for seen_pu, then in ((0.7, "70 %"), (None, "none")):
        seen = daemon.commands.automatic(Role.ENGINEER, seen_pu, goes=seen_pu is not None)
        said = f"nothing was written: the reference that waits is 90 % now, it was {then}"
        assert seen == Confirmation(False, said)
    assert daemon.writes == []
    assert not daemon.commands.automatic(Role.OPERATOR, 0.9, goes=True).done, "mode needs an engineer"


def test_manual_commands_the_pressure_that_was_agreed_to(daemon: Daemon) -> None:
    assert daemon.commands.manual(Role.ENGINEER, 40e3).done
    assert daemon.writes == [(Role.ENGINEER, "manual_pressure", 40e3), (Role.ENGINEER, "mode", Mode.MANUAL)]
    assert not daemon.commands.manual(Role.ENGINEER, -1.0).done
    assert not daemon.commands.manual(Role.ENGINEER, math.nan).done
    assert len(daemon.writes) == 2


def test_a_write_that_reads_back_otherwise_is_not_confirmed(daemon: Daemon) -> None:
    daemon.leaves.add("mode")
    seen = daemon.commands.set_mode(Role.ENGINEER, Mode.MANUAL)
    assert seen == Confirmation(False, "mode was written, but reads back automatic")


@pytest.mark.parametrize("role", [Role.NONE, Role.OBSERVER])
def test_an_observer_writes_nothing(daemon: Daemon, role: Role) -> None:
    said = [
        daemon.commands.set_reference(role, 0.2),
        daemon.commands.set_mode(role, Mode.HOLD),
        daemon.commands.acknowledge(role),
        daemon.commands.identify(role, {}, lambda _: None),
    ]
    assert [each.text for each in said] == [
        "reference needs the role operator",
        "mode needs the role engineer",
        "acknowledge needs the role operator",
        "identification needs the role engineer",
    ]
    assert not any(each.done for each in said)
    assert daemon.writes == []


def test_an_operator_has_the_reference_and_the_acknowledgement_and_no_more(daemon: Daemon) -> None:
    assert daemon.commands.set_reference(Role.OPERATOR, 0.2).done
    assert daemon.commands.acknowledge(Role.OPERATOR).done
    assert not daemon.commands.set_mode(Role.OPERATOR, Mode.HOLD).done
    assert not daemon.commands.identify(Role.OPERATOR, {}, lambda _: None).done


def test_nothing_is_written_on_values_that_are_not_of_now(daemon: Daemon) -> None:
    daemon.picture = replace(daemon.picture, freshness=Freshness("the last reading is 3.0 s old"))
    seen = daemon.commands.set_reference(Role.ENGINEER, 0.2)
    assert seen == Confirmation(False, "nothing was written: the last reading is 3.0 s old")
    assert daemon.writes == []


def test_a_fault_that_stays_is_said(daemon: Daemon) -> None:
    daemon.values["fault"] = Fault.NO_REPLY
    seen = daemon.commands.acknowledge(Role.OPERATOR)
    assert seen == Confirmation(False, "acknowledged, the fault stays: no reply")


def test_a_daemon_that_is_gone_is_one_line(daemon: Daemon) -> None:
    daemon.away = True
    assert daemon.commands.set_reference(Role.ENGINEER, 0.2) == Confirmation(False, "no daemon answers there")


def test_an_identification_waits_for_its_permissives(daemon: Daemon) -> None:
    daemon.values["mode"] = Mode.HOLD
    seen = daemon.commands.identify(Role.ENGINEER, {}, lambda _: None)
    assert not seen.done
    assert "not automatic" in seen.text


def test_an_identification_shows_its_progress_and_may_be_broken_off(daemon: Daemon) -> None:
    shown: list[float] = []
    assert daemon.commands.identify(Role.ENGINEER, {}, shown.append) == Confirmation(True, "identified and applied")
    assert shown == [0.0, 0.5, 1.0]
    daemon.break_off_after = 0.5
    seen = daemon.commands.identify(Role.ENGINEER, {}, shown.append)
    assert seen == Confirmation(False, "broken off; the law has the command again")
    assert issubclass(BrokenOff, Exception)


def test_a_second_identification_waits_for_the_first_to_end(daemon: Daemon) -> None:
    second: list[Confirmation] = []

    def ask_again(progress: float) -> None:
        if not second:
            second.append(daemon.commands.identify(Role.ENGINEER, {}, lambda _: None))

    assert daemon.commands.identify(Role.ENGINEER, {}, ask_again).done
    assert second == [Confirmation(False, "an identification is under way already")]


def test_the_end_breaks_an_identification_off_and_waits_for_it(daemon: Daemon) -> None:
    begun, ends = Event(), Event()
    said: list[Confirmation] = []

    def wait(_: float) -> None:
        begun.set()
        assert ends.wait(60.0)

    work = Thread(target=lambda: said.append(daemon.commands.identify(Role.ENGINEER, {}, wait)))
    work.start()
    assert begun.wait(60.0)
    Thread(target=ends.set).start()
    daemon.commands.end()
    assert daemon.commands.identify(Role.ENGINEER, {}, lambda _: None).done, "the first has ended"
    work.join()
    assert len(said) == 1

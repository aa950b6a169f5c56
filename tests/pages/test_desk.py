"""What lies on a desk: a step back brings it again, and what is shown goes home as words of a command line."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from config.errors import CommandFailed, InputError
from config.recording import Recording
from positioner.pages.workbench_page.background import Limits, News, Raced, diagnosed
from positioner.pages.workbench_page.command_lines import command_lines
from positioner.pages.workbench_page.desk import SAVED, Desk, NamedValve
from positioner.pages.workbench_page.opening import ColumnChoice, Opened, opened_like
from workbench.blind.hiding import hide

HIDDEN = hide(7, duration_s=5.0)
FIRST, OTHER = Opened("fit.csv", Path("fit.csv"), HIDDEN.fit), Opened("other.csv", Path("other.csv"), HIDDEN.test)
VALVE = NamedValve("valve.toml", Path("valve.toml"), HIDDEN.base)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    desk = Desk(folder=tmp_path / "desk")
    desk.folder.mkdir()
    desk.take_valve(VALVE)
    desk.take_recording(FIRST)
    yield desk
    desk.clear()


def test_step_by_step_all_of_it_is_undone(desk: Desk) -> None:
    live = desk.live
    assert live is not None
    given_m = live.curve().rms_m
    live.keep()
    live.move(live.parameters["spring_n_per_m"], 0.7)
    desk.take_recording(OTHER)
    assert desk.undo()
    assert desk.opened == FIRST
    assert desk.live is not None
    assert desk.live.curve().rms_m != given_m
    assert desk.undo()
    assert desk.compared is not None
    assert desk.compared.rms_m == pytest.approx(given_m)
    assert desk.undo()
    assert desk.valve == VALVE
    assert list(command_lines(desk)) == []
    assert desk.undo()
    assert not desk.undo()


def test_what_is_held_out_and_how_long_it_may_take_stands_on_the_command_line(desk: Desk) -> None:
    desk.hold_out(OTHER)
    desk.budget_s = 90.0
    compare, diagnose = command_lines(desk)
    assert compare == "positioner compare fit.csv --valve valve.toml"
    assert diagnose == "positioner diagnose fit.csv --valve valve.toml --test other.csv --budget-s 90"
    desk.take_recording(FIRST)
    assert desk.held_out is None


def test_a_recording_that_cannot_be_held_out_is_refused_and_nothing_changes(desk: Desk) -> None:
    still = Recording({"time_s": HIDDEN.fit.columns["time_s"], "command_pa": HIDDEN.fit.columns["command_pa"]})
    with pytest.raises(InputError, match="position_m"):
        desk.hold_out(replace(OTHER, recording=still))
    assert desk.held_out is None


def test_an_export_is_held_out_as_the_first_was_read(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text("t;PV;OUT\n" + "".join(f"{i / 100};{i};{100 * i}\n" for i in range(500)))
    choice = ColumnChoice({"time_s": "t:s", "position_m": "PV:mm", "command_pa": "OUT:Pa"})
    found = opened_like(tmp_path / "b.csv", "b.csv", replace(FIRST, choice=choice))
    assert found.recording.columns["position_m"][100] == pytest.approx(0.1)
    with pytest.raises(InputError, match="their columns differ"):
        opened_like(tmp_path / "b.csv", "b.csv", FIRST)


def test_a_kept_curve_stays_when_the_valve_gets_better_and_goes_with_another_recording(desk: Desk) -> None:
    desk.keep_variant()
    kept_m = desk.variants[SAVED]
    desk._go_on(VALVE, {})
    assert desk.variants[SAVED] is kept_m
    desk.take_recording(OTHER)
    assert SAVED not in desk.variants


def test_a_time_that_is_over_at_once_says_that_nothing_is_known() -> None:
    told: list[News] = []
    with pytest.raises(CommandFailed, match="nothing is known"):
        diagnosed(told.append, HIDDEN.fit, HIDDEN.base, Limits(HIDDEN.test, 0.0), ["backlash"])
    assert not any(isinstance(each, Raced) for each in told)

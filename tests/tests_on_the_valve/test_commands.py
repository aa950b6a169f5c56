"""The commands of tests on a running valve: what they print, keep and return; the daemon is in virtual time."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from config.codes import ExperimentState, Mode
from config.errors import CommandFailed
from config.slave_file import Initial
from positioner.cli.main import main
from positioner.cli.parts.valve_test import recordings_of
from positioner.history.kept_tests import folder_of
from positioner.tests_on_the_valve.kept_records import Record, records
from positioner.tests_on_the_valve.program import Played, Program
from tests.tests_on_the_valve.virtual_valve import (
    AREA_M2,
    MAXIMUM_PA,
    MIDWAY,
    SLOPE,
    STROKE_M,
    VirtualValve,
    daemon_file,
    told,
)

TIGHT = told(coulomb_n=400.0, static_n=440.0)
WIDE_OPEN = Initial(position_m=STROKE_M, pressure_pa=130e3)
SITE = f"""[valve]
name = "FV-1"
stroke_m = {STROKE_M}
[pressure]
maximum_pa = {MAXIMUM_PA}
[history]
folder = "history"
[experiment]
travel_window = [0, 1]
limit_s = 40
"""


class InMemory(VirtualValve):
    """In place of `RunningValve`."""

    def stem_m(self) -> float:
        return self.cycle.snapshot.sample.position_m

    def slope_pa_per_m(self) -> float:
        return SLOPE

    def dead_band_pa(self) -> float:
        return 840.0 / AREA_M2


class Interrupted(InMemory):
    """Whose tester presses Ctrl-C."""

    def play(self, program: Program) -> Played:
        raise KeyboardInterrupt


class Taken(InMemory):
    """Whose law takes the stem elsewhere after each program."""

    def play(self, program: Program) -> Played:
        assert program.points[0] == (0.0, self.command_pa()), "it begins with the command in force"
        played = super().play(program)
        asked = self.cycle.requests
        by_hand = {"manual_pa": self.command_pa() - 2e3, "manual_writes": asked.manual_writes + 1}
        for mode, also in ((Mode.MANUAL, by_hand), (Mode.AUTOMATIC, {})):
            asked = replace(asked, mode=mode, mode_writes=asked.mode_writes + 1, **also)  # type: ignore[arg-type]
            self.cycle.requests = asked
            self.watch(1.0)
        return played


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "site.toml"
    path.write_text(SITE)
    monkeypatch.setattr("positioner.cli.parts.experiment_player.require_ready", lambda *_: None)
    serve(monkeypatch, InMemory)
    return path


def serve(monkeypatch: pytest.MonkeyPatch, kind: type[InMemory], initial: Initial = WIDE_OPEN) -> None:
    valve = kind(TIGHT, daemon_file(experiment={"limit_s": 60.0}), initial=initial)
    monkeypatch.setattr("positioner.cli.parts.experiment_player.RunningValve", lambda *_: valve)


def kept(site: Path) -> list[Record]:
    return records(folder_of(site.parent / "history", "FV-1"))


def test_a_partial_stroke_is_kept_trended_and_may_claim_its_credit(
    site: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told_json = site.parent / "pst.json"
    assert main(["pst", str(site), "--keep", "as_left", "--json", str(told_json)]) == 0
    assert "no reference: friction and times are not judged" in capsys.readouterr().out
    assert main(["pst", str(site), "--failure-rate-per-h", "1e-6"]) == 0
    out = capsys.readouterr().out
    assert "the last 2 of 2" in out
    assert "PFD_avg 0.0156 with this test every 30 days, 0.0285 without it" in out
    assert [each.kind for each in kept(site)] == ["as_left", ""]
    found = json.loads(told_json.read_text())
    assert (found["test"], found["passed"]) == ("partial stroke test", True)
    assert found["figures"]["reached_m"]["plus_minus"] is not None
    assert main(["pst", str(site), "--travel", "0.9"]) == 2
    assert "--travel: allowed is 0.01 to 0.5 of the stroke, got 0.9" in capsys.readouterr().err
    assert main(["pst", str(site), "--failure-rate-per-h", "1e-6", "--every-days", "4000"]) == 2
    assert "--every-days: allowed is 0 to 1826.25, got 4000" in capsys.readouterr().err


def test_one_that_is_broken_off_by_ctrl_c_is_kept_as_no_reference(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    serve(monkeypatch, Interrupted)
    assert main(["pst", str(site), "--keep", "as_left"]) == 130
    (record,) = kept(site)
    assert (record.kind, record.outcome.said) == ("", "broken off")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["cst", "--rate", "0.01", "--start", "0.002"], "break-away friction, as a pressure"),
        (["steps", "--held-s", "0.3"], "resolution, of the span"),
    ],
    ids=["continuous stroke", "steps"],
)
def test_the_others_pass_and_print_their_figures(
    words: list[str], said: str, site: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    serve(monkeypatch, InMemory, MIDWAY)
    command, *options = words
    assert main([command, str(site), "--keep", "as_found", *options]) == 0
    assert said in capsys.readouterr().out
    assert [each.kind for each in kept(site)] == ["as_found"]


def test_each_way_of_a_continuous_stroke_begins_where_the_law_has_landed_after_the_other(
    site: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the way to its first command is no rest, and the stem was said not to have moved."""
    serve(monkeypatch, Taken, MIDWAY)
    assert main(["cst", str(site), "--rate", "0.01", "--start", "0.002"]) == 0


def test_a_continuous_stroke_that_has_no_time_to_break_the_stem_loose_is_refused(
    site: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["cst", str(site)]) == 2
    assert "--rate: at 0.0005 the command goes 1120 Pa in half of experiment.limit_s" in capsys.readouterr().err
    assert kept(site) == []


def test_steps_of_a_stem_at_its_end_are_refused(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["steps", str(site)]) == 1
    assert "the stem is at an end, where steps move nothing" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("state", "left"),
    [
        (ExperimentState.VETOED, "the law commands the valve again"),
        (ExperimentState.FAULT, "the action of the fault commands the valve"),
        (ExperimentState.NOT_AUTOMATIC, "the command before is held"),
    ],
)
def test_what_has_the_valve_after_a_test_that_was_broken_off_is_said(state: ExperimentState, left: str) -> None:
    with pytest.raises(CommandFailed, match=f"; {left}$"):
        recordings_of([Played(None, state, state.text)])

"""What lies on a desk: a step back brings it again, and what is shown goes home as words of a command line."""

import argparse
import json
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from config.errors import CommandFailed, InputError
from config.recording import Recording
from config.valve_file import shipped_valve
from positioner.cli.parts.export_arguments import add_export_arguments, mapping_of
from tests.pages.laid_out import hidden
from workbench.diagnosis.extension import extend
from workbench.imports.export_mapping import ExportMapping
from workbench.imports.export_preview import preview
from workbench.page import desk as desk_module
from workbench.page.background import Limits, News, Raced, Work, run_diagnosis
from workbench.page.command_lines import command_lines
from workbench.page.desk import SAVED, Desk, name_valve
from workbench.page.notebook import notebook
from workbench.page.provenance import NamedValve
from workbench.page.recording_opening import Export, Opened, map_export, open_file_like, wrong_with
from workbench.page.search import Search
from workbench.page.search_panel import SearchPanel


@cache
def first() -> Opened:
    return Opened.of("fit.csv", Path("fit.csv"), hidden().fit)


@cache
def other() -> Opened:
    return Opened.of("other.csv", Path("other.csv"), hidden().test)


@cache
def valve() -> NamedValve:
    return NamedValve("valve.toml", Path("valve.toml"), hidden().base)


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    desk = Desk(folder=tmp_path / "desk")
    desk.folder.mkdir()
    desk.take_valve(valve())
    desk.take_recording(first())
    yield desk
    desk.clear()


def test_step_by_step_all_of_it_is_undone(desk: Desk) -> None:
    live = desk.live
    assert live is not None
    given_m = live.curve().rms_m
    live.keep()
    live.move(live.parameters["spring_n_per_m"], 0.7)
    desk.take_recording(other())
    assert desk.undo()
    assert desk.opened == first()
    assert desk.live is not None
    assert desk.live.curve().rms_m != given_m
    assert desk.undo()
    assert desk.compared is not None
    assert desk.compared.rms_m == pytest.approx(given_m)
    assert desk.undo()
    assert desk.valve == valve()
    assert list(command_lines(desk)) == []
    assert desk.undo()
    assert not desk.undo()


def test_what_is_held_out_and_how_long_it_may_take_stands_on_the_command_line(desk: Desk) -> None:
    desk.hold_out(other())
    desk.budget_s = 90.0
    diagnose, compare = command_lines(desk)
    assert compare == "positioner compare fit.csv --valve valve.toml"
    assert diagnose == "positioner diagnose fit.csv --valve valve.toml --test other.csv --budget-s 90"
    desk.take_recording(first())
    assert desk.held_out is None


def test_a_recording_that_cannot_be_held_out_is_refused_and_nothing_changes(desk: Desk) -> None:
    in_percent = {**hidden().fit.columns, "position_m": 1000.0 * hidden().fit.columns["position_m"]}
    with pytest.raises(InputError, match="it looks like per cent"):
        desk.hold_out(Opened.of("percent.csv", Path("percent.csv"), Recording(in_percent)))
    assert desk.held_out is None


def test_an_export_is_held_out_as_the_first_was_read(tmp_path: Path) -> None:
    (tmp_path / "b.csv").write_text("t;PV;OUT\n" + "".join(f"{i / 100};{i};{100 * i}\n" for i in range(500)))
    choice = ExportMapping(column=("time_s=t:s", "position_m=PV:mm", "command_pa=OUT:Pa"))
    found = open_file_like(tmp_path / "b.csv", "b.csv", replace(first(), choice=choice))
    assert found.recording.columns["position_m"][100] == pytest.approx(0.1)
    with pytest.raises(InputError, match="their columns differ"):
        open_file_like(tmp_path / "b.csv", "b.csv", first())


def test_a_kept_curve_stays_when_the_valve_gets_better_and_goes_with_another_recording(desk: Desk) -> None:
    desk.keep_variant()
    kept_m = desk.variants[SAVED]
    desk.go_on(valve(), {})
    assert desk.variants[SAVED] is kept_m
    desk.take_recording(other())
    assert SAVED not in desk.variants


def test_blind_practice_draws_what_can_be_seen(desk: Desk, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn = {3: [0.2, 0.1], 4: [0.9, 0.1], 5: [0.9, 0.8]}
    blind: list[int] = []
    answers = {
        seed: {"visible": {str(i): {"is_visible": each > 0.5} for i, each in enumerate(shows)}}
        for seed, shows in drawn.items()
    }
    monkeypatch.setattr(desk_module, "hide", lambda seed: SimpleNamespace(answer=answers[seed]))
    monkeypatch.setattr(Desk, "blind", lambda _, seed: blind.append(seed))
    desk.blind_practice(3)
    assert blind == [5]


def test_a_form_that_was_discovered_goes_home_as_a_file_and_as_the_command_that_finds_it(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.may_write_effects = True
    monkeypatch.setattr(desk_module, "Work", lambda *_, **__: SimpleNamespace(is_over=True, is_alive=False))
    form = SimpleNamespace(text=lambda source: f'"""Of {source}."""\n')
    desk.discover()
    assert desk.search is not None
    desk.search.result = SimpleNamespace(found=[form])
    desk.extend_by_form(desk.search)
    assert desk.effects["found_1"].read_text() == '"""Of fit.csv."""\n'
    desk.add(extend(hidden().fit, hidden().base, []), desk.search, None)
    discover, added, _ = command_lines(desk)
    assert discover == "positioner discover fit.csv --valve valve.toml -o found_1.py"
    assert added.startswith("positioner extend valve.toml ")


def test_a_time_that_is_over_at_once_says_that_nothing_is_known() -> None:
    told: list[News] = []
    with pytest.raises(CommandFailed, match="nothing is known"):
        run_diagnosis(told.append, hidden().fit, hidden().base, Limits(hidden().test, 0.0), ["backlash"])
    assert not any(isinstance(each, Raced) for each in told)


def test_the_notebook_reads_an_export_as_it_was_read(desk: Desk) -> None:
    columns = ("time_s=t:s", "position_m=PV:%", "command_pa=OUT:%")
    choice = ExportMapping(column=columns, stroke_m=0.04, range_pa=(1e4, 9e4), decimal=",")
    assert desk.opened is not None
    desk.opened = replace(first(), choice=choice)
    text = notebook(desk)
    source = "".join("".join(cell["source"]) for cell in json.loads(text)["cells"] if "ExportMapping(" in str(cell))
    written = re.search(r"ExportMapping\((.*?)\)\.read\(", source, re.DOTALL)
    assert written is not None
    assert eval(f"ExportMapping({written[1]})") == choice


@pytest.mark.parametrize(
    "choice",
    [
        ExportMapping(column=("time_s=t:s", "position_m=PV:mm", "command_pa=OUT:%")),
        ExportMapping(column=("time_s=t:s", "position_m=PV:mm", "command_pa=OUT:mA"), range_pa=(0.0, 1.2e5)),
        ExportMapping(column=("time_s=t:s", "position_m=PV:mm", "command_pa=OUT:bar"), range_pa=(0.0, 1.2e5)),
        ExportMapping(column=("position_m=PV:mm", "command_pa=OUT:%"), period_s=0.5, status=("Q=Good",)),
    ],
)
def test_the_words_of_a_choice_read_the_file_as_the_page_does(choice: ExportMapping, tmp_path: Path) -> None:
    shown = {"OUT:bar": 0.5, "OUT:mA": 12.0}.get(choice.theirs["command_pa"], 50.0)
    rows = [f"{0.5 * i},{i % 7},{shown + i % 3},Good" for i in range(60)]
    (tmp_path / "a.csv").write_text("\n".join(["t,PV,OUT,Q", *rows]))
    read = map_export(Export("a.csv", tmp_path / "a.csv", preview(tmp_path / "a.csv")), choice)
    parser = argparse.ArgumentParser()
    add_export_arguments(parser)
    again = mapping_of(parser.parse_args([*choice.words])).read(tmp_path / "a.csv")
    np.testing.assert_array_equal(again.command_pa, read.recording.command_pa)
    np.testing.assert_array_equal(again.time_s, read.recording.time_s)
    assert again.metadata == read.recording.metadata, "what was assumed is told by both"
    assumed = any(each.startswith("assumed: command_pa") for each in wrong_with(read, None))
    assert assumed is ("OUT:%" in choice.theirs["command_pa"])


def test_a_dropped_valve_file_whose_own_effect_stayed_behind_says_so(tmp_path: Path) -> None:
    dropped = tmp_path / "upload-1.toml"
    dropped.write_text(shipped_valve("seed").read_text() + '\n[[effect]]\nname = "./tight_spot.py"\n')
    with pytest.raises(InputError, match=r"^mine\.toml: names tight_spot\.py, an effect of your own"):
        name_valve(str(dropped), "mine.toml")


def test_the_race_and_the_errors_are_in_the_unit_that_was_chosen(desk: Desk) -> None:
    over = cast(Work, SimpleNamespace(is_over=True))
    desk.search = Search("diagnose", valve(), first(), None, over, race={"backlash": 2.54e-3})
    panel = cast(SearchPanel, SimpleNamespace(_desk=desk))
    for unit, error in {"mm": 2.54, "in": 0.1}.items():
        desk.units.position = unit
        drawn = SearchPanel.draw(panel)
        assert drawn["data"][0]["x"] == pytest.approx([error])
        assert f"fitted error, {unit} rms" in str(drawn["layout"]["xaxis"])
        assert (desk.errors.shown(2.54e-3).text, desk.errors.unit) == (f"{error:g}", unit)
    assert desk.errors.shown(None).text == "–"

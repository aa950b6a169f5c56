"""What goes home is what was on the page: any sequence of actions, replayed by its command lines and by its notebook.

Both end at the same valve, bit by bit, and at the same error. A refit of the same recording and valve is made once: a
replay that asks for another is seen by where it ends.
"""

import json
import random
import shlex
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest

import positioner as pos
from config.data_sheet import DataSheet, from_data_sheet
from config.recording import Recording, write_recording
from config.valve_file import ValveFile, load_valve
from config.valve_file_writer import valve_toml, write_valve
from positioner.cli.main import main
from tests.pages.laid_out import hidden
from workbench.diagnosis import diagnosis as diagnosis_module
from workbench.diagnosis import extension as extension_module
from workbench.page import background
from workbench.page import desk as desk_module
from workbench.page.background import Finished, News
from workbench.page.command_lines import command_lines
from workbench.page.desk import Desk, name_valve
from workbench.page.notebook import notebook
from workbench.page.provenance import DataSheetMade, NamedValve
from workbench.page.recording_opening import Opened

TRIED = ("preload", "sensor_offset")
ACTED, SEQUENCES = 8, 8
"""Actions in a sequence that chance chooses; how many of these."""


class Now:
    """A work that is done at once, here."""

    def __init__(self, task: Callable[..., Any], *arguments: Any, own_effects: Path) -> None:
        self._result = task(lambda _: None, *arguments)
        self.is_over = self.is_alive = False

    def news(self) -> list[News]:
        self.is_over = True
        return [Finished(self._result)]

    def cancel(self) -> None:
        self.is_over = True


def told_apart(of: Any) -> str:
    """Return what tells an argument of a refit from another, to the last bit."""
    match of:
        case Recording():
            return "".join(f"{name} {hash(column.tobytes())}" for name, column in of.columns.items())
        case ValveFile():
            return valve_toml(of)
        case diagnosis_module.Diagnosis():
            return f"diagnosis of {valve_toml(of.best.fit.valve)} {[each.name for each in of.candidates]}"
        case list() | tuple():
            return str([told_apart(each) for each in of])
    return repr(of)


MADE: dict[str, Any] = {}


def once(function: Callable[..., Any]) -> Callable[..., Any]:
    def made(*arguments: Any, **named: Any) -> Any:
        recording, *others = arguments
        given = [recording] if isinstance(recording, Recording) else recording
        quiet = {key: each for key, each in named.items() if not callable(each) and each not in (None, 0, False)}
        key = told_apart([function.__name__, given, others, sorted((k, told_apart(v)) for k, v in quiet.items())])
        if key not in MADE:
            MADE[key] = function(*arguments, **named)
        return MADE[key]

    return made


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(desk_module, "Work", Now)
    extend, diagnose = once(extension_module.extend), once(diagnosis_module.diagnose)
    for module in (extension_module, background, pos):
        monkeypatch.setattr(module, "extend", extend, raising=False)
    for module in (diagnosis_module, background, pos):
        monkeypatch.setattr(module, "diagnose", diagnose, raising=False)
    write_recording(tmp_path / "fit.csv", hidden().fit)
    write_recording(tmp_path / "other.csv", hidden().test)
    write_valve(tmp_path / "valve.toml", hidden().base)
    desk = Desk(folder=tmp_path / "desk")
    desk.folder.mkdir()
    desk.take_valve(name_valve("valve.toml"))
    desk.take_recording(recording("fit.csv"))
    yield desk
    desk.clear()


@cache
def read(name: str, where: Path) -> Opened:
    return Opened.of(name, where / name, Recording.read(where / name))


def recording(name: str) -> Opened:
    return read(name, Path.cwd())


def searched(desk: Desk) -> None:
    assert desk.search is not None
    assert desk.search.look()
    desk.take(desk.search)


def drag(desk: Desk, chance: random.Random) -> None:
    live = desk.live
    assert live is not None
    name = chance.choice([each for each in live.parameters if each != "static_n"])
    live.keep()
    live.move(live.parameters[name], live.share(live.parameters[name]) + chance.uniform(-0.02, 0.02))
    desk.compare()


def switch(desk: Desk, chance: random.Random) -> None:
    live = desk.live
    assert live is not None
    if live.effects:
        effect = chance.choice(live.effects)
        live.switch(effect, effect in live.setting.off)
        desk.compare()


def undo(desk: Desk, _: random.Random) -> None:
    if desk.journal:  # else it may take back the recording
        desk.undo()


def keep(desk: Desk, _: random.Random) -> None:
    desk.keep_variant()


def fit(desk: Desk, _: random.Random) -> None:
    desk.extend(())
    searched(desk)


def diagnose(desk: Desk, _: random.Random) -> None:
    if desk.live and not desk.live.effects:
        desk.diagnose(TRIED)
        searched(desk)


def add(desk: Desk, chance: random.Random) -> None:
    """Press an effect: in the table of a diagnosis, or without one."""
    if desk.live and not desk.live.effects:
        desk.extend([chance.choice(TRIED)])
        searched(desk)


def add_verdict(desk: Desk, _: random.Random) -> None:
    if desk.diagnosed and desk.diagnosed.result.sure:
        desk.add_verdict(desk.diagnosed)


def back(desk: Desk, _: random.Random) -> None:
    if desk.journal:
        desk.walk_back()


def hold_out(desk: Desk, _: random.Random) -> None:
    assert desk.opened is not None
    other = recording("other.csv" if desk.opened.name == "fit.csv" else "fit.csv")
    desk.hold_out(None if desk.held_out else other)


def other_recording(desk: Desk, chance: random.Random) -> None:
    desk.take_recording(recording(chance.choice(["fit.csv", "other.csv"])))


Action = Callable[[Desk, random.Random], None]
ACTIONS: tuple[Action, ...] = (
    drag,
    switch,
    undo,
    keep,
    fit,
    diagnose,
    add,
    add_verdict,
    back,
    hold_out,
    other_recording,
)
FIXED: tuple[tuple[Action, ...], ...] = (
    (drag, diagnose, add, switch, drag, fit, back),
    (hold_out, add, other_recording, drag, fit),
    (drag, diagnose, add_verdict),
)
"""Sequences that once ended elsewhere, put together: the drag is the same, so that there is one diagnosis."""


def replayed_by_commands(desk: Desk, capsys: pytest.CaptureFixture[str]) -> tuple[ValveFile, float]:
    """Type what is printed; return the valve at the end and its error, m."""
    lines = [shlex.split(each)[1:] for each in command_lines(desk)]
    for words in lines:
        if words[0] == "diagnose" and "-o" not in words:
            continue  # what might be asked next: minutes, and no valve
        assert main(words) in (0, 1), f"{words}: {capsys.readouterr().err}"
    compare = lines[-1]
    assert compare[0] == "compare"
    main([*compare, "--json", "compared.json"])
    capsys.readouterr()
    return load_valve(compare[compare.index("--valve") + 1]), json.loads(Path("compared.json").read_text())["rms_m"]


def replayed_by_notebook(desk: Desk) -> tuple[ValveFile, float]:
    cells = [cell for cell in json.loads(notebook(desk))["cells"] if cell["cell_type"] == "code"]
    names: dict[str, Any] = {}
    for cell in cells:
        code = "".join(cell["source"])
        if ".plot()" not in code and not (code.startswith("found = ") and not desk.journal):
            exec(code, names)
    return names["valve"], names["compared"].rms_m


def ends_the_same_at_home(
    desk: Desk, capsys: pytest.CaptureFixture[str], actions: Sequence[Action], chance: random.Random
) -> None:
    for action in actions:
        action(desk, chance)
    assert desk.live is not None
    assert desk.compared is not None
    here = valve_toml(desk.live.valve), desk.compared.rms_m
    for valve, rms_m in (replayed_by_commands(desk, capsys), replayed_by_notebook(desk)):
        assert (valve_toml(valve), rms_m) == here
    Path("saved.toml").write_text(desk.toml)
    changed = [f"{name} = " for name in desk.live.moved] + [f"without {each}" for each in desk.live.switched_off]
    assert all(f"with {each}" in desk.toml for each in changed), "what was set by hand is said in the file"
    assert valve_toml(load_valve("saved.toml")) == here[0]


@pytest.mark.parametrize("actions", FIXED, ids=lambda actions: ", ".join(each.__name__ for each in actions))
def test_a_sequence_of_actions_ends_at_the_same_valve_and_error_at_home(
    desk: Desk, capsys: pytest.CaptureFixture[str], actions: Sequence[Action]
) -> None:
    ends_the_same_at_home(desk, capsys, actions, random.Random(1))


@pytest.mark.long
@pytest.mark.parametrize("seed", range(SEQUENCES))
def test_so_does_any_sequence(desk: Desk, capsys: pytest.CaptureFixture[str], seed: int) -> None:
    chance = random.Random(seed)
    ends_the_same_at_home(desk, capsys, chance.choices(ACTIONS, k=ACTED), chance)


def test_what_a_data_sheet_and_a_blind_case_gave_goes_home_too(desk: Desk) -> None:
    desk.blind(7)
    lines = command_lines(desk)
    assert lines[0] == "positioner hide --seed 7 -o blind-7"
    assert lines[-1] == "positioner compare blind-7/fit.csv --valve blind-7/valve.toml"
    assert "pos.hide(7).base" in notebook(desk)
    sheet = DataSheet(699.5, (0.2, 1.0), 101.6, None, 1.31)
    file, _, _ = from_data_sheet(sheet)
    desk.take_valve(NamedValve("data-sheet.toml", desk.folder / "data-sheet.toml", file, DataSheetMade(sheet)))
    (made,) = [shlex.split(each)[1:] for each in command_lines(desk) if " valve " in each]
    assert main(made) == 0
    assert valve_toml(load_valve("data-sheet.toml")) == valve_toml(file)


def test_the_report_is_of_what_was_added_not_of_what_was_found(desk: Desk) -> None:
    from workbench.page.journal_panel import write_report

    drag(desk, random.Random(1))
    desk.diagnose(TRIED)
    searched(desk)
    assert desk.diagnosed is not None
    assert desk.diagnosed.result.missing == ("preload",)
    desk.extend(["sensor_offset"])
    searched(desk)
    write_report(desk, Path("report.html"))
    said = Path("report.html").read_text(encoding="utf-8")
    assert "sensor_offset added" in said
    assert "preload added" not in said

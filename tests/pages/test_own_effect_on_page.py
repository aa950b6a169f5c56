"""An effect written on the page: checked by line, tried with the others, run by nobody else."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from config.errors import InputError
from config.valve_file import valve
from sim.effect import FOLDERS_ALLOWED, find_effect
from sim.own_effect import EXAMPLE, check_effect
from tests.pages.laid_out import hidden
from tests.waiting import until
from workbench.page.background import Finished, News, Progressed, Work
from workbench.page.command_lines import command_lines
from workbench.page.desk import Desk
from workbench.page.provenance import NamedValve
from workbench.page.recording_opening import Opened

TEXT = EXAMPLE.read_text(encoding="utf-8")


@pytest.fixture
def desk(tmp_path: Path) -> Iterator[Desk]:
    desk = Desk(folder=tmp_path / "desk", may_write_effects=True)
    desk.folder.mkdir()
    desk.take_valve(NamedValve("valve.toml", tmp_path / "valve.toml", hidden().base))
    desk.take_recording(Opened.of("fit.csv", tmp_path / "fit.csv", hidden().fit))
    yield desk
    desk.clear()


def test_the_example_is_the_one_of_the_documents() -> None:
    page = (Path(__file__).parents[2] / "docs" / "effects.md").read_text(encoding="utf-8")
    assert TEXT in page


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("depth = (x", "depth = x)", r"line 30: unmatched '\)'"),
        ("from math import exp", "from math import expo", "line 8: ImportError: cannot import name 'expo'"),
        ("more = q.excess_n", "more = q.nothing", r"Unknown attribute 'nothing'.*own\.py\", line 31"),
        ("LOOKS = ", "A = 1 / 0\nLOOKS = ", "line 13: ZeroDivisionError"),
        ("x: float, q", "where: float, q", "friction: unknown argument where; allowed: "),
        (", starts=(0.05, 0.2, 0.8)", "", "declares no starts"),
    ],
)
def test_what_is_wrong_is_said_with_its_line(right: str, wrong: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "own.py"
    path.write_text(TEXT.replace(right, wrong))
    with pytest.raises(InputError, match=said):
        check_effect(path, valve("seed").valve)


def test_a_shipped_effects_name_is_taken(tmp_path: Path) -> None:
    (tmp_path / "backlash.py").write_text(TEXT)
    with pytest.raises(InputError, match="choose another"):
        check_effect(tmp_path / "backlash.py", valve("seed").valve)


def end_of(work: Work) -> News:
    ends: list[News] = []

    def came() -> bool:
        ends.extend(each for each in work.news() if not isinstance(each, Progressed))
        return bool(ends)

    until(came, "the end")
    return ends[0]


@pytest.mark.patient
def test_a_checked_effect_is_run_by_the_desk_that_wrote_it_and_by_nobody_else(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDERS_ALLOWED, str(Path(__file__).parent))
    path = desk.write_effect("tight_spot", TEXT)
    with pytest.raises(InputError, match="lies in no folder allowed"):
        find_effect(str(path), "effects")
    desk.check_effect(path)
    assert desk.checking is not None
    assert end_of(desk.checking) == Finished(None)
    desk.keep_effect("tight_spot")
    assert find_effect(str(path), "effects").name == "tight_spot"
    assert re.search(r"diagnose fit\.csv .*--effects \./tight_spot\.py ", command_lines(desk)[0])
    desk.clear()
    assert not path.exists()
    path.parent.mkdir(parents=True)
    path.write_text(TEXT)
    with pytest.raises(InputError, match="lies in no folder allowed"):
        find_effect(str(path), "effects")


@pytest.mark.patient
def test_an_effect_that_never_ends_is_stopped_with_its_tab(desk: Desk) -> None:
    desk.check_effect(desk.write_effect("endless", "while True: pass\n"))
    work = desk.checking
    assert work is not None
    until(lambda: bool(work.news()), "the first word")
    assert work.is_alive
    desk.stop()
    assert not work.is_alive


@pytest.mark.parametrize("name", ["", "../up", "a/b", "Über", "1st", "a" * 41])
def test_a_name_is_a_name_and_no_path(name: str, desk: Desk) -> None:
    with pytest.raises(InputError, match="must be small letters"):
        desk.write_effect(name, TEXT)


def test_where_strangers_may_come_nobody_writes_a_program(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="listens to this machine alone"):
        Desk(folder=tmp_path).write_effect("tight_spot", TEXT)

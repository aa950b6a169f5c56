"""An effect of an engineer's own, as docs/effects.md has it: fitted, diagnosed and extended by its file's path."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from config.errors import InputError
from config.recording import write_recording
from config.valve_file import load_valve
from config.valve_file_writer import valve_toml, write_valve
from positioner.cli.main import main
from sim.effect import FOLDERS_ALLOWED, find_effect
from tests.workbench.valves import drawn_valve, record_of, with_effect
from workbench.diagnosis.extension_journal import Journal
from workbench.fit.fitting import fit

PAGE = Path(__file__).parents[2] / "docs" / "effects.md"
BARE = drawn_valve(np.random.default_rng(11))
SPOT = {"excess_n": 900.0, "position_m": 0.045, "width_m": 0.002}
COUNT = 1500


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The documented effect, a recording of a valve that has it, what is known, and a folder for the new valve."""
    folder = tmp_path_factory.mktemp("own")
    match = re.search(r'```python\n(""".*?tight spot.*?)```', PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert match
    (folder / "effects").mkdir()
    (folder / "valves").mkdir()
    spot = folder / "effects" / "tight_spot.py"
    spot.write_text(match[1], encoding="utf-8")
    write_recording(folder / "rec.csv", record_of(with_effect(BARE, str(spot), **SPOT), 5, COUNT))
    (folder / "known.toml").write_text(valve_toml(BARE), encoding="utf-8")
    return folder


@pytest.fixture
def here(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(folder)
    return folder


def test_diagnose_finds_it_by_its_path(here: Path) -> None:
    words = ["diagnose", "rec.csv", "--valve", "known.toml", "--effects", "./effects/tight_spot.py"]
    assert main([*words, "--json", "said.json", "--report", "said.html"]) == 1
    said = json.loads((here / "said.json").read_text())
    assert said["missing"] == ["effects/tight_spot.py"]
    assert said["best"]["test_rmse_m"] < 0.5 * said["base"]["test_rmse_m"]
    assert said["best"]["parameters"]["tight_spot.position_m"]["value"] == pytest.approx(0.045, abs=5e-4)
    assert "jumps when it gets past" in (here / "said.html").read_text(encoding="utf-8")


def test_extend_names_it_as_seen_from_the_new_file(here: Path) -> None:
    words = ["extend", "known.toml", "--effect", "./effects/tight_spot.py", "--fit", "rec.csv"]
    assert main([*words, "-o", "valves/new.toml", "--json", "said.json"]) == 0
    assert 'name = "../effects/tight_spot.py"' in (here / "valves" / "new.toml").read_text()
    assert main(["compare", "rec.csv", "--valve", "valves/new.toml"]) == 0
    assert main([*words[:1], "valves/new.toml", *words[2:], "-o", "valves/again.toml"]) == 2
    said = json.loads((here / "said.json").read_text())
    assert said["falls"] is True
    assert said["extended"]["test_rmse_m"] < 0.5 * said["refitted"]["test_rmse_m"]
    step = Journal.beside(here / "valves" / "new.toml").steps[0]
    assert said["extended"]["test_rmse_m"] == step.extended_test_rmse_m
    assert said["extended"]["parameters"]["tight_spot.excess_n"]["value"] == step.parameters["tight_spot.excess_n"]
    assert said["valve"] == "valves/new.toml"


def test_a_fitted_valve_keeps_the_path(here: Path) -> None:
    recording = record_of(with_effect(BARE, "effects/tight_spot.py", **SPOT), 5, COUNT)
    found = fit(recording, with_effect(BARE, "effects/tight_spot.py", **SPOT), free=("coulomb_n",))
    assert [each.name for each in found.valve.effect] == ["effects/tight_spot.py"]


def test_a_file_written_elsewhere_is_read_back_as_the_same_valve(here: Path) -> None:
    valve = with_effect(BARE, str(here / "effects" / "tight_spot.py"), **SPOT)
    write_valve(here / "valves" / "moved.toml", valve, ["a remark"])
    assert load_valve(here / "valves" / "moved.toml") == valve
    assert (here / "valves" / "moved.toml").read_text().startswith("# a remark\n[valve]\n")
    assert 'name = "../effects/tight_spot.py"' in (here / "valves" / "moved.toml").read_text()


def test_an_effect_by_its_path_is_a_program_run_only_from_folders_allowed(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A valve file that came by mail must not run what came with it, nor anything run without a word."""
    ran = tmp_path / "mail" / "odd.py"
    ran.parent.mkdir()
    ran.write_text((folder / "effects" / "tight_spot.py").read_text())
    (tmp_path / "work").mkdir()
    monkeypatch.chdir(tmp_path / "work")
    monkeypatch.delenv(FOLDERS_ALLOWED)
    for path in (ran, Path("../mail/odd.py")):
        with pytest.raises(InputError, match=r"lies in no folder allowed.*POSITIONER_EFFECTS=.*mail"):
            find_effect(str(path), "valve.toml")
    (tmp_path / "work" / "link.py").symlink_to(ran)
    with pytest.raises(InputError, match="lies in no folder allowed"):
        find_effect("link.py", "valve.toml")
    assert not caplog.records
    monkeypatch.setenv(FOLDERS_ALLOWED, str(ran.parent))
    for source in ("valve.toml", "valve.toml", "valve file"):
        assert find_effect(str(ran), source).name == "odd"
    assert caplog.messages == [f"valve.toml names an effect by its path: {ran} is run as a program"]


def test_a_play_that_declares_no_start_is_searched_from_where_it_does_nothing(tmp_path: Path) -> None:
    shipped = find_effect("backlash", "shipped effects").path.read_text(encoding="utf-8")
    play = tmp_path / "own_play.py"
    play.write_text(re.sub(r" starts=\(.*?\),", "", shipped), encoding="utf-8")
    recording = record_of(BARE, 5, COUNT)
    base = fit(recording, BARE)
    found = fit(recording, BARE, effects=(str(play),), base=base)
    assert "own_play.width_m" in found.parameters
    assert found.cost <= base.cost + 0.5, "no effect makes a valve worse"

"""Fleet: manifests, a small plant on real workers, killed workers and clients, reruns, what changed since."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import positioner as pos
from config.errors import CommandFailed, InputError
from config.slave_file import Sensor
from config.valve_file import ValveFile, valve
from config.writing import write_valve
from positioner.cli.main import main
from sim.composition import Composition
from workbench.blind.input_signal import excitation
from workbench.blind.trial import Trial
from workbench.fleet import engine
from workbench.fleet.examination import Examination, Request, examine
from workbench.fleet.fleet import fleet
from workbench.fleet.manifest import read_manifest
from workbench.fleet.store import Store, request_key
from workbench.fleet.tables import write_tables

HEAD = "valve,file,recording,when\n"
ROWS, PERIOD_S = 1000, 0.02
TIGHTER = {"coulomb_n": 2200.0, "static_n": 2600.0}
PLAY = {"name": "backlash", "width_m": 4e-3}


def record(file: ValveFile, path: Path, seed: int) -> None:
    """Record a valve under a command that shows what it is."""
    path.parent.mkdir(exist_ok=True)
    trial = Trial(excitation(valve("seed").valve, np.random.default_rng(seed), ROWS), PERIOD_S)
    composition = Composition.from_file(file)
    answer_m = trial.answer_m(composition, composition.theta)
    trial.recording(answer_m, Sensor(noise_std_m=5e-5, seed=seed)).write(path)


def plant(folder: Path) -> Path:
    """A valve that is well, one whose packing was tightened, one with play, one with a recording of garbage."""
    well = valve("seed")
    tight = well.model_copy(update={"valve": well.valve.model_copy(update=TIGHTER)})
    with_play = ValveFile.model_validate({"valve": well.valve.model_dump(), "effect": [PLAY]})
    write_valve(folder / "seed.toml", well)
    rows = []
    for number, (name, autumn) in enumerate({"well": well, "tight": tight, "play": with_play, "bad": well}.items()):
        record(well, folder / "recordings" / f"{name}-1.csv", 2 * number)
        record(autumn, folder / "recordings" / f"{name}-2.csv", 2 * number + 1)
        rows += [f"{name},seed.toml,recordings/{name}-{i}.csv,2026-0{i}-01\n" for i in (1, 2)]
    (folder / "recordings" / "bad-2.csv").write_text("no recording\n")
    (folder / "plant.csv").write_text(HEAD + "".join([*rows, "absent,none.toml,recordings/absent.csv,2026-01-01\n"]))
    return folder / "plant.csv"


class Straight:
    """In place of Dask: examines where it stands."""

    def __enter__(self) -> "Straight":
        return self

    def __exit__(self, *_: object) -> None:
        pass


def straight(_client: object, courses: Any, told: Any) -> None:
    for course in courses:
        while (request := course.following()) is not None:
            course.take(examine(request))


@pytest.fixture
def without_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("workbench.fleet.fleet.work", straight)
    monkeypatch.setattr("workbench.fleet.fleet.cluster", lambda *_: Straight())


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    return plant(tmp_path_factory.mktemp("plant"))


@pytest.mark.usefixtures("without_dask")
def test_the_valves_are_ranked_by_what_their_recordings_say(site: Path, tmp_path: Path) -> None:
    found = fleet(site, tmp_path / "out")
    assert [course.name for course in found.complaining] == ["play", "tight"]
    play, tight = found.complaining
    assert (play.kind, play.sure) == ("play or stop", "sure")
    assert play.gravest
    assert play.gravest[1].effects == ("backlash",)
    assert f"{play.gravest[0].time:%m}" == "02"
    assert tight.kind == "sticks"
    assert {each.name for each in tight.gravest[1].changes} >= {"coulomb_n"}  # type: ignore[index]
    assert {(name, entry.recording) for name, entry, _ in found.bad} == {
        ("bad", "recordings/bad-2.csv"),
        ("absent", "recordings/absent.csv"),
    }
    assert (found.count, len(found.courses)) == (9, 5)
    assert found.summary().startswith("2 of 5 valves deserve a look; 9 recordings, ")

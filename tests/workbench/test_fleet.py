"""Fleet: manifests, a small plant on real workers, killed workers and clients, reruns, what changed since."""

import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from distributed import KilledWorker
from distributed.comm.core import CommClosedError
from pyarrow import parquet

from config.errors import CommandFailed
from config.slave_file import Sensor
from config.valve_file import ValveFile, valve
from config.writing import write_valve
from positioner.cli.main import main
from sim.composition import Composition
from workbench.blind.input_signal import excitation
from workbench.blind.trial import Trial
from workbench.fleet import engine
from workbench.fleet.examination import examine
from workbench.fleet.fleet import fleet
from workbench.fleet.manifest import read_manifest
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


def play() -> ValveFile:
    return ValveFile.model_validate({"valve": valve("seed").valve.model_dump(), "effect": [PLAY]})


def plant(folder: Path) -> Path:
    """A valve that is well, one whose packing was tightened, one with play, one with a recording of garbage."""
    well = valve("seed")
    tight = well.model_copy(update={"valve": well.valve.model_copy(update=TIGHTER)})
    write_valve(folder / "seed.toml", well)
    rows = []
    for number, (name, autumn) in enumerate({"well": well, "tight": tight, "play": play(), "bad": well}.items()):
        record(well, folder / "recordings" / f"{name}-1.csv", 2 * number)
        record(autumn, folder / "recordings" / f"{name}-2.csv", 2 * number + 1)
        rows += [f"{name},seed.toml,recordings/{name}-{i}.csv,2026-0{i}-01\n" for i in (1, 2)]
    (folder / "recordings" / "bad-2.csv").write_text("no recording\n")
    (folder / "small.csv").write_text(HEAD + "".join(rows[:4] + rows[6:]))
    (folder / "plant.csv").write_text(HEAD + "".join([*rows, "absent,none.toml,recordings/absent.csv,2026-01-01\n"]))
    return folder / "plant.csv"


class Straight:
    """In place of Dask: examines where it stands."""

    def __enter__(self) -> "Straight":
        return self

    def __exit__(self, *_: object) -> None:
        pass


def straight(_client: object, courses: Any) -> None:
    for course in courses:
        while (request := course.following()) is not None:
            course.take(examine(request))


@pytest.fixture
def without_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("workbench.fleet.fleet.work", straight)
    monkeypatch.setattr("workbench.fleet.fleet.cluster", lambda *_: Straight())


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return plant(tmp_path_factory.mktemp("plant"))


@pytest.fixture(scope="module")
def ranked(site: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a whole run."""
    out = tmp_path_factory.mktemp("ranked")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("workbench.fleet.fleet.work", straight)
        patch.setattr("workbench.fleet.fleet.cluster", lambda *_: Straight())
        assert main(["fleet", str(site), "--out", str(out), "--report", str(out / "fleet.html")]) == 1
    return out


def tables(out: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in out.glob("*.parquet")}


def test_the_valves_are_ranked_by_what_their_recordings_say(site: Path, ranked: Path, without_dask: None) -> None:
    found = fleet(site, ranked)
    assert [course.name for course in found.complaining] == ["play", "tight"]
    loose, tight = found.complaining
    assert (loose.kind, loose.sure) == ("play or stop", "sure")
    assert loose.gravest
    assert loose.gravest[1].effects == ("backlash",)
    assert f"{loose.gravest[0].time:%m}" == "02"
    assert tight.kind == "sticks"
    assert {each.name for each in tight.gravest[1].changes} >= {"coulomb_n"}  # type: ignore[index]
    assert {(name, entry.recording) for name, entry, _ in found.bad} == {
        ("bad", "recordings/bad-2.csv"),
        ("absent", "recordings/absent.csv"),
    }
    assert (found.count, len(found.courses)) == (9, 5)
    assert found.summary().startswith("2 of 5 valves deserve a look; 9 recordings, ")


def test_a_second_run_examines_nothing_anew_and_is_the_same_to_the_byte(
    site: Path, ranked: Path, capsys: pytest.CaptureFixture[str], without_dask: None
) -> None:
    before, page = tables(ranked), (ranked / "fleet.html").read_bytes()
    assert len(before) == 3
    main(["fleet", str(site), "--out", str(ranked), "--report", str(ranked / "fleet.html"), "--since", "2026-01-15"])
    assert (tables(ranked), (ranked / "fleet.html").read_bytes()) == (before, page)
    said = capsys.readouterr().out
    assert "9 recordings, 1 of them examined now" in said, "the unreadable one, which is tried again"
    assert "since 2026-01-15: 2 valves have another model" in said
    assert re.search(r"play +backlash.width_m +none +0.00\d", said)
    assert re.search(r"tight +coulomb_n +1423.4 .*\+5\d\.\d %", said)


def test_a_new_recording_is_held_against_the_model_that_the_last_one_left(
    site: Path, ranked: Path, tmp_path: Path, without_dask: None
) -> None:
    shutil.copytree(site.parent, tmp_path / "site")
    shutil.copytree(ranked, tmp_path / "out")
    record(play(), tmp_path / "site" / "recordings" / "play-3.csv", 99)
    with (tmp_path / "site" / "plant.csv").open("a") as file:
        file.write("play,seed.toml,recordings/play-3.csv,2026-03-01\n")
    found = fleet(tmp_path / "site" / "plant.csv", tmp_path / "out")
    assert found.examined == 2, "the new one, and the unreadable one again"
    course = next(course for course in found.courses if course.name == "play")
    assert [each.outcome for _, each in course.examined] == ["as_before", "missing", "as_before"]
    assert course.gravest
    assert f"{course.gravest[0].time:%m}" == "02", "it still complains, since then"


def test_the_page_and_the_tables_tell_what_was_found(ranked: Path) -> None:
    page = (ranked / "fleet.html").read_text()
    assert page.index("play or stop") < page.index("sticks")
    assert "positioner diagnose recordings/play-2.csv --valve seed.toml --report play.html" in page
    assert "recordings/bad-2.csv: column time_s is missing" in page
    assert page.count("<svg") == 2
    assert "://" not in page
    rows = parquet.read_table(ranked / "valves.parquet").to_pylist()
    assert [row["valve"] for row in rows[:2]] == ["play", "tight"]
    assert rows[0]["effects"] == "backlash"
    assert rows[0]["cost_share"] == pytest.approx(0.0196, rel=0.05)
    models = parquet.read_table(ranked / "models.parquet").to_pylist()
    assert {row["valve"] for row in models} == {"play", "tight"}
    assert ValveFile.model_validate(tomllib.loads(models[0]["text"]))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("valve,file,when\n", "columns must be valve, file, recording, when, got valve, file, when"),
        (HEAD, "recording: "),
        (HEAD + "a,seed,r.csv,yesterday\n", "recording.0.when"),
        (HEAD + "a,seed,r.csv,2026-01-01\na,ordinary,s.csv,2026-01-02\n", "a: file is seed and ordinary; a valve has"),
        (HEAD + "a,seed,r.csv,2026-01-01\nb,seed,r.csv,2026-01-02\n", "r.csv: valve is a and b; it is of one valve"),
        (HEAD + "a,seed,r.csv,2026-01-01\na,seed,s.csv,2026-01-01\n", "a: two recordings of 2026-01-01"),
        (
            HEAD + "a,seed,r.csv,2026-01-01T00:00Z\na,seed,s.csv,2026-02-01\n",
            "when: some times have an offset and some",
        ),
    ],
)
def test_a_manifest_that_is_wrong_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, said: str
) -> None:
    path = tmp_path / "plant.csv"
    path.write_text(text)
    assert main(["fleet", str(path), "--out", str(tmp_path / "out")]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert said in err
    assert not (tmp_path / "out").exists()


def test_a_manifest_may_be_toml_and_have_semicolons(tmp_path: Path) -> None:
    (tmp_path / "plant.toml").write_text(
        "[[recording]]\nvalve = 'a'\nfile = 'seed'\nrecording = 'r.csv'\nwhen = 2026-01-02\n"
    )
    (tmp_path / "plant.csv").write_text("\ufeffwhen;valve;file;recording\n2026-01-02;a;seed;r.csv\n", encoding="utf-8")
    manifests = [read_manifest(tmp_path / name) for name in ("plant.toml", "plant.csv")]
    assert manifests[0].valves == manifests[1].valves


def test_a_folder_of_another_form_is_refused(site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "fleet.json").write_text('{"form": 7}\n')
    assert main(["fleet", str(site), "--out", str(tmp_path)]) == 2
    assert "form: is 7, allowed is 1" in capsys.readouterr().err


class Future:
    """An answer of Dask's that is none."""

    def __init__(self, status: str, error: Exception | None = None) -> None:
        self.status, self._error = status, error

    def exception(self) -> Exception | None:
        return self._error

    def result(self) -> None:
        raise CommClosedError


def test_a_recording_that_kills_its_workers_is_listed_and_a_scheduler_that_is_gone_said() -> None:
    died: Any = KilledWorker
    killed = engine._answer(Future("error", died("examine-1", None, 3)))
    assert killed.outcome == "unreadable"
    assert killed.sentence == "the workers that examined it died"
    for status in ("cancelled", "lost", "finished"):
        with pytest.raises(CommandFailed, match="the same command goes on from there"), engine._told_when_gone():
            engine._answer(Future(status))


@pytest.mark.patient
def test_no_scheduler_is_one_line(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "CONNECT_WITHIN_S", 0.5)
    assert main(["fleet", str(site), "--out", str(tmp_path / "out"), "--scheduler", "tcp://127.0.0.1:1"]) == 2
    err = capsys.readouterr().err
    assert err.splitlines()[-1].startswith("positioner fleet: tcp://127.0.0.1:1: no scheduler answers there")


@pytest.mark.patient
def test_a_killed_worker_and_then_a_killed_client_lose_nothing(site: Path, tmp_path: Path, without_dask: None) -> None:
    out, small = tmp_path / "out", site.with_name("small.csv")
    words = [sys.executable, "-m", "positioner.cli", "fleet", str(small), "--out", str(out), "--workers", "1"]
    with subprocess.Popen(words, stderr=subprocess.DEVNULL, text=True) as client:
        until(lambda: kept(out) >= 1)
        (worker,) = workers_of(client.pid)
        worker.kill()
        until(lambda: kept(out) >= 3)
        left = workers_of(client.pid)
        client.kill()
    until(lambda: not any(each.is_running() for each in left))
    before = kept(out)
    found = fleet(small, out)
    assert found.examined == 6 - before, "five that can be read, and the unreadable one"
    write_tables(found.courses, out)
    write_tables(fleet(small, tmp_path / "whole").courses, tmp_path / "whole")
    assert tables(out) == tables(tmp_path / "whole")


def kept(out: Path) -> int:
    return len(list(out.glob("examinations/*/*.json")))


def workers_of(pid: int) -> list[psutil.Process]:
    children = psutil.Process(pid).children(recursive=True)
    return [each for each in children if "spawn_main" in " ".join(each.cmdline())]


def until(holds: Callable[[], bool]) -> None:
    end_s = time.monotonic() + 250.0
    while not holds():
        assert time.monotonic() < end_s
        time.sleep(0.02)

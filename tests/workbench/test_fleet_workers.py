"""Fleets on Dask: workers, clients and schedulers that are killed, recordings that hang or kill."""

import shutil
from pathlib import Path
from typing import Any

import psutil
import pytest

from config.errors import CommandFailed
from positioner.cli.main import main
from tests.children import FORKS, Child
from tests.waiting import until
from tests.workbench.fleets import HEAD, examined_here, plant, serve_cluster, tables
from workbench.fleet import engine
from workbench.fleet.fleet import fleet
from workbench.fleet.tables import write_tables

ROOT = Path(__file__).parents[2]
PATIENCE_S = 250.0
"""For workers that are started on a busy machine."""


@pytest.fixture
def without_dask(monkeypatch: pytest.MonkeyPatch) -> None:
    examined_here(monkeypatch)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return plant(tmp_path_factory.mktemp("plant"))


class Future:
    """An answer of Dask's that is none."""

    def __init__(self, status: str, error: Exception | None = None) -> None:
        self.status, self._error, self.key = status, error, "examine-1"

    def exception(self) -> Exception | None:
        return self._error

    def result(self) -> None:
        from distributed.comm.core import CommClosedError

        raise CommClosedError


def test_a_recording_that_kills_its_workers_is_listed_and_a_scheduler_that_is_gone_said() -> None:
    from distributed import KilledWorker

    died: Any = KilledWorker
    killed = engine.answer_of(Future("error", died("examine-1", None, 3)), set(), 1.0)
    assert killed.outcome == "unreadable"
    assert killed.sentence == "the workers that examined it died"
    for status in ("cancelled", "lost", "finished"):
        with pytest.raises(CommandFailed, match="the same command goes on from there"), engine.tell_when_gone():
            engine.answer_of(Future(status), set(), 1.0)
    assert engine.answer_of(Future("cancelled"), {"examine-1"}, 9.0).sentence == "not examined within 9 s"


@pytest.mark.patient
def test_no_scheduler_is_one_line(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "CONNECT_WITHIN_S", 0.5)
    assert main(["fleet", str(site), "--out", str(tmp_path / "out"), "--scheduler", "tcp://127.0.0.1:1"]) == 2
    err = capsys.readouterr().err
    assert err.splitlines()[-1].startswith("positioner fleet: tcp://127.0.0.1:1: no scheduler answers there")


def test_a_task_runs_since_those_before_it_at_its_worker_are_through() -> None:
    clocks = engine.TaskClocks()
    clocks.look({"here": ["first"], "there": ["other"]}, {"here": 1, "there": 1}, 0.0)
    clocks.look({"here": ["behind", "first"], "there": ["other"]}, {"here": 1, "there": 1}, 5.0)
    assert clocks.late(1.0) == [("here", "first"), ("there", "other")]
    clocks.look({"here": ["behind"]}, {"here": 1}, 6.0)
    assert clocks.late(5.9) == []
    assert clocks.late(6.1) == [("here", "behind")]


@pytest.mark.long
@pytest.mark.patient
def test_a_recording_that_takes_too_long_is_listed_and_tried_again(
    site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An effect of one's own, a program, that does not come back in a worker."""
    own = (ROOT / "sim" / "effects" / "preload.py").read_text()
    endless = "import multiprocessing, time\nif multiprocessing.parent_process() is not None:\n    time.sleep(1e6)\n"
    (tmp_path / "endless.py").write_text(own + endless)
    text = (site.parent / "seed.toml").read_text() + "\n[[effect]]\nname = './endless.py'\nforce_n = 10.0\n"
    (tmp_path / "seed.toml").write_text(text)
    shutil.copy(site.parent / "recordings" / "well-1.csv", tmp_path / "r.csv")
    (tmp_path / "plant.csv").write_text(HEAD + "V,seed.toml,r.csv,2026-01-01\n")
    monkeypatch.setenv("POSITIONER_EFFECTS", str(tmp_path))
    found = fleet(tmp_path / "plant.csv", tmp_path / "out", workers=1, time_limit_s=2.0)
    assert [reason for *_, reason in found.bad] == ["not examined within 2 s"]
    assert kept(tmp_path / "out") == 0
    monkeypatch.delenv("POSITIONER_EFFECTS")
    found = fleet(tmp_path / "plant.csv", tmp_path / "out", workers=1)
    assert "lies in no folder allowed" in found.bad[0][2], "listed as well: the others would go on"


@pytest.mark.patient
@pytest.mark.long
def test_a_killed_worker_and_then_a_killed_client_lose_nothing(site: Path, tmp_path: Path, without_dask: None) -> None:
    out = tmp_path / "out"
    small = Path(shutil.copy(site.with_name("small.csv"), site.with_name("killed.csv")))
    client = Child("fleet", small, "--out", str(out), "--workers", "1", starts_others=True)
    try:
        until(lambda: kept(out) >= 1, "the first recording", PATIENCE_S)
        (worker,) = workers_of(client.pid)
        worker.kill()
        until(lambda: kept(out) >= 3, "the third recording", PATIENCE_S)
        left = workers_of(client.pid)
        client.kill()
    finally:
        client.close()
    until(lambda: not any(each.is_running() for each in left), "the end of the workers", PATIENCE_S)
    before = kept(out)
    found = fleet(small, out)
    assert found.examined == 6 - before, "five that can be read, and the unreadable one"
    write_tables(found.courses, out)
    write_tables(fleet(small, tmp_path / "whole").courses, tmp_path / "whole")
    assert tables(out) == tables(tmp_path / "whole")


@pytest.mark.patient
def test_a_scheduler_that_is_killed_is_one_line_and_the_same_command_goes_on(
    site: Path, tmp_path: Path, without_dask: None
) -> None:
    out, small = tmp_path / "out", site.with_name("small.csv")
    heard, said = FORKS.Pipe(duplex=False)
    scheduler = FORKS.Process(target=serve_cluster, args=(said,), daemon=True)
    scheduler.start()
    said.close()
    client = Child("fleet", small, "--out", str(out), "--scheduler", heard.recv())
    try:
        until(lambda: kept(out) >= 2, "the second recording", PATIENCE_S)
        scheduler.kill()
        status, _, log = client.ended()
    finally:
        scheduler.kill()
        client.close()
    assert status == 1, log
    assert log.splitlines()[-1] == f"positioner fleet: {engine.GONE}"
    assert "Traceback" not in log
    before = kept(out)
    assert fleet(small, out).examined == 6 - before


def kept(out: Path) -> int:
    return len(list(out.glob("examinations/*/*.json")))


def workers_of(pid: int) -> list[psutil.Process]:
    children = psutil.Process(pid).children(recursive=True)
    return [each for each in children if "spawn_main" in " ".join(each.cmdline())]

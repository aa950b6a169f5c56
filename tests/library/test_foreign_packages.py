"""Other people's `config`: never executed by our processes, named in one line where it is in the way."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from config.recording import Recording
from positioner.cli import doctor
from positioner.cli.parts.children import running
from positioner.daemon.refinement_process import RefinementProcess
from positioner.estimation.batch import BatchSettings
from positioner.estimation.refiner import RefinementJob
from positioner.own_packages import sharing

EXECUTED = "from pathlib import Path\nPath(__file__).with_name('executed').touch()\n"
PATH = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


FOREIGN = ("config.py", "sim/__init__.py")


@pytest.fixture(params=FOREIGN)
def foreign(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Stand in a folder with a foreign module; it must not be executed."""
    file = left(tmp_path, str(request.param))
    monkeypatch.chdir(tmp_path)
    yield file
    assert not file.with_name("executed").exists(), "a foreign module was executed"


@pytest.fixture
def _foreigners(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Stand in a folder with both; neither must be executed."""
    files = [left(tmp_path, each) for each in FOREIGN]
    monkeypatch.chdir(tmp_path)
    yield
    assert not any(each.with_name("executed").exists() for each in files), "a foreign module was executed"


def left(folder: Path, name: str) -> Path:
    file = folder / name
    file.parent.mkdir(exist_ok=True)
    file.write_text(EXECUTED)
    return file


def run(*words: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(words, capture_output=True, text=True, check=False, timeout=60, env=PATH)


def told(foreign: Path) -> str:
    name = foreign.stem if foreign.stem != "__init__" else foreign.parent.name
    return f"{foreign.resolve()} is in the way of positioner's own package {name}: start from another folder"


@pytest.mark.usefixtures("_foreigners")
def test_the_command_does_not_see_it() -> None:
    assert run("positioner", "map").returncode == 0
    Recording({"time_s": np.arange(9.0), "command_pa": np.zeros(9), "position_m": np.zeros(9)}).write("rec.csv")
    estimated = run("positioner", "estimate", "rec.csv")
    assert (estimated.returncode, estimated.stderr) == (1, "")
    assert "9 samples" in estimated.stdout
    Path("daemon.toml").write_text("[valve]\nstroke_m = 0.1\n[device]\nport = 1\n")
    examined = run("positioner", "doctor", "daemon.toml").stdout
    assert "packages     ok    config, signals, " in examined
    assert "positioner's own" in examined


def test_started_as_a_module_the_command_says_what_is_in_the_way(foreign: Path) -> None:
    done = run(sys.executable, "-m", "positioner.cli", "doctor", "daemon.toml")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"positioner: {told(foreign)}")
    assert done.stderr.count("\n") == 1


def test_the_library_says_what_is_in_the_way(foreign: Path) -> None:
    done = run(sys.executable, "-c", "import positioner as pos; pos.valve('seed')")
    assert done.stderr.splitlines()[-1].startswith(f"ImportError: positioner.valve: {told(foreign)}")


@pytest.mark.usefixtures("_foreigners")
def test_a_child_does_not_see_it() -> None:
    Path("slave.toml").write_text('valve = "seed"\n')
    with running("sim", Path("slave.toml"), "--listen-port", "0") as ready:
        assert "127.0.0.1:" in ready


@pytest.mark.usefixtures("_foreigners")
def test_the_refinement_process_does_not_see_it() -> None:
    process = RefinementProcess()
    refiner = process.refiner(blocking=True)
    time_s = np.arange(0.0, 0.2, 1e-3)
    assert refiner.submit(RefinementJob(time_s, 0.0 * time_s, 0.0 * time_s, BatchSettings(noise_std_m=1e-5)))
    assert refiner.collect() is not None
    assert process.alive
    process.stop()


def test_doctor_names_a_distribution_that_installed_over_ours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert sharing() == ""
    metadata = tmp_path / "settings_for_all-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: settings-for-all\nVersion: 1.0\n")
    (metadata / "top_level.txt").write_text("config\n")
    monkeypatch.syspath_prepend(tmp_path)
    assert not doctor.passes("packages", "", doctor.check_packages)
    line = capsys.readouterr().out
    assert line.startswith("packages     FAILS settings-for-all has installed its own config among positioner's: start")
    assert line.count("\n") == 1

"""Where Python runs, all runs but the daemon: it says in one line what it needs, or what it goes without.

The systems are pretended (`pretended.py`): what they lack is taken away before anything is loaded.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PROFILES = ROOT / "config" / "profiles"
JUDGES = ROOT.parent / "shared" / "cases" / "exports" / "26-platform"
WITHIN_S = 120.0
ROOMS = ("config", "signals", "webpage", "sim", "workbench", "fieldbus", "drivers", "positioner", "northbound")
OF_POSIX_ALONE = (
    "daemon/ending",
    "daemon/service.py",
    "daemon/assembled_valves.py",
    "daemon/workers.py",
    "positioner/testing/",
    "parts/pseudo_line",
    "terminal.py",
)
"""What a daemon, a serial line and the tests of others need."""


def command(system: str, *words: str) -> list[str]:
    return [sys.executable, "-m", "tests.cli.pretended", system, *words]


def ended(words: list[str]) -> subprocess.CompletedProcess[str]:
    # numpy asks os.uname for what this switches off, which the judges take away.
    environment = {**os.environ, "NUMPY_MADVISE_HUGEPAGE": "0"}
    return subprocess.run(
        words, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=WITHIN_S, check=False
    )


@contextmanager
def going(words: list[str]) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """Give what it says first, and the process, which is killed if it has not ended."""
    process = subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        yield process.stdout.readline(), process
    finally:
        process.kill()
        process.communicate()


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    time_s = np.arange(0.0, 8.0, 0.02)
    command_pa = 60e3 + 20e3 * np.sin(time_s)
    position_m = 0.04 + 0.02 * np.sin(time_s - 0.2)
    rows = np.column_stack((time_s, command_pa, position_m))
    path = tmp_path / "rec.csv"
    np.savetxt(path, rows, delimiter=",", header="time_s,command_pa,position_m", comments="")
    return path


def test_on_windows_the_daemon_says_in_one_line_what_it_needs() -> None:
    for words in (command("windows", "run", str(PROFILES / "daemon.toml")), judged("winsim", "run", "daemon.toml")):
        refused = ended(words)
        assert refused.returncode == 2
        (line,) = refused.stderr.splitlines()
        assert "has no signals that end a process in order and no locks on files, which the daemon needs" in line


def judged(script: str, name: str, profile: str) -> list[str]:
    """Return the command as a script of others has it, or as ours does where that is not there."""
    path = JUDGES / f"{script}.py"
    if not path.exists():
        return command({"winsim": "windows", "macsim": "macos"}[script], name, str(PROFILES / profile))
    return [sys.executable, str(path), "positioner", name, str(PROFILES / profile)]


def test_on_windows_everything_else_can_be_loaded() -> None:
    files = (each for room in ROOMS for each in files_of(room))
    modules = [str(each.with_suffix("")).replace(os.sep, ".").removesuffix(".__init__") for each in files]
    script = (
        "import sys, importlib; from tests.cli.pretended import as_windows; as_windows();"
        "[importlib.import_module(each) for each in sys.argv[1:]]"
    )
    loaded = ended([sys.executable, "-c", script, *modules])
    assert loaded.returncode == 0, loaded.stderr[-2000:]


def files_of(room: str) -> Iterator[Path]:
    for each in sorted((ROOT / room).rglob("*.py")):
        path = each.relative_to(ROOT)
        if each.stem != "__main__" and not any(known in path.as_posix() for known in OF_POSIX_ALONE):
            yield path


@pytest.mark.parametrize("system", ["windows", "macos"])
def test_recordings_are_read_and_compared(system: str, recording: Path) -> None:
    for words in (["import", str(recording)], ["compare", str(recording), "--valve", "seed"]):
        done = ended(command(system, *words))
        assert done.returncode in (0, 1), done.stderr
        assert "Traceback" not in done.stderr
    assert "residual: " in done.stdout


@pytest.mark.real_time
@pytest.mark.parametrize("page", ["workbench", "page"])
def test_on_windows_the_pages_are_served(page: str) -> None:
    with going(command("windows", page, "--no-open")) as (said, _):
        where = urlsplit(said.split()[-1])
        with closing(HTTPConnection(where.netloc, timeout=WITHIN_S)) as line:
            line.request("GET", f"{where.path}?{where.query}")
            assert line.getresponse().status in (200, 302, 303, 307)


def test_on_windows_a_serial_line_is_refused_in_one_line() -> None:
    refused = ended(command("windows", "probe", str(PROFILES / "daemon_rtu.toml")))
    assert refused.returncode == 1
    assert "serial lines need termios, which this system has not" in refused.stdout


@pytest.mark.real_time
@pytest.mark.parametrize("judge", [False, True], ids=["", "by a script of others"])
def test_on_macos_the_daemon_runs_and_says_what_it_goes_without(tmp_path: Path, judge: bool) -> None:
    config = tmp_path / "daemon.toml"
    with going([sys.executable, "-m", "positioner.cli", "sim", str(PROFILES / "slave.toml"), "--listen-port", "0"]) as (
        where,
        _,
    ):
        port = where.strip().rpartition(":")[2]
        config.write_text(
            f"[valve]\nstroke_m = 0.1016\n[device]\nport = {port}\nreply_timeout_s = 5.0\n[supervisory]\nport = 0\n"
        )
        words = judged("macsim", "run", str(config)) if judge else command("macos", "run", str(config))
        with going(words) as (said, daemon):
            assert said.startswith("serving valve on ")
            daemon.terminate()
            _, log = daemon.communicate(timeout=WITHIN_S)
        assert daemon.returncode == 0
    (line,) = (each for each in log.splitlines() if "cycles are less punctual on this system" in each)
    assert "real-time priority (SCHED_FIFO)" in line
    assert "short timer slack (prctl)" in line
    assert "Traceback" not in log

"""Where Python runs, all runs but the daemon: it says in one line what it needs, or what it goes without.

The systems are pretended (`pretended.py`): what they lack is taken away before anything is loaded.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
PROFILES = ROOT / "config" / "profiles"
WITHIN_S = 120.0
ROOMS = ("config", "signals", "webpage", "sim", "workbench", "fieldbus", "drivers", "positioner", "northbound")
OF_POSIX_ALONE = (
    "daemon/end_signals",
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
    return subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=WITHIN_S, check=False)


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
    refused = ended(command("windows", "run", str(PROFILES / "daemon.toml")))
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert "has no signals that end a process in order and no locks on files, which the daemon needs" in line


def test_on_windows_everything_else_can_be_loaded_and_recordings_are_read_and_compared(recording: Path) -> None:
    files = (each for room in ROOMS for each in files_of(room))
    modules = [str(each.with_suffix("")).replace(os.sep, ".").removesuffix(".__init__") for each in files]
    script = (
        "import sys, importlib; from tests.cli.pretended import as_windows; as_windows();"
        "[importlib.import_module(each) for each in sys.argv[2:]]; from positioner.cli.main import main;"
        "sys.exit(max(main(['import', sys.argv[1]]), main(['compare', sys.argv[1], '--valve', 'seed'])))"
    )
    done = ended([sys.executable, "-c", script, str(recording), *modules])
    assert done.returncode in (0, 1), done.stderr[-2000:]
    assert "Traceback" not in done.stderr
    assert "residual: " in done.stdout


def files_of(room: str) -> Iterator[Path]:
    for each in sorted((ROOT / room).rglob("*.py")):
        path = each.relative_to(ROOT)
        if each.stem != "__main__" and not any(known in path.as_posix() for known in OF_POSIX_ALONE):
            yield path


def test_on_windows_a_serial_line_is_refused_in_one_line() -> None:
    refused = ended(command("windows", "probe", str(PROFILES / "daemon_rtu.toml")))
    assert refused.returncode == 1
    assert "serial lines need termios, which this system has not" in refused.stdout

"""On a pretended system, what goes on until it is ended: the pages, and on macOS the daemon."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from http.client import HTTPConnection
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.cli.test_platforms import PROFILES, ROOT, WITHIN_S, command

pytestmark = pytest.mark.real_time


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


def test_on_windows_a_page_is_served() -> None:
    """The workbench's: both pages are served by the same server."""
    with going(command("windows", "workbench", "--no-open")) as (said, _):
        where = urlsplit(said.split()[-1])
        with closing(HTTPConnection(where.netloc, timeout=WITHIN_S)) as line:
            line.request("GET", f"{where.path}?{where.query}")
            assert line.getresponse().status in (200, 302, 303, 307)


def test_on_macos_the_daemon_runs_and_says_what_it_goes_without(tmp_path: Path) -> None:
    config = tmp_path / "daemon.toml"
    with going([sys.executable, "-m", "positioner.cli", "sim", str(PROFILES / "slave.toml"), "--listen-port", "0"]) as (
        where,
        _,
    ):
        port = where.strip().rpartition(":")[2]
        config.write_text(
            f"[valve]\nstroke_m = 0.1016\n[device]\nport = {port}\nreply_timeout_s = 5.0\n[supervisory]\nport = 0\n"
        )
        with going(command("macos", "run", str(config))) as (said, daemon):
            assert said.startswith("serving valve on ")
            daemon.terminate()
            _, log = daemon.communicate(timeout=WITHIN_S)
        assert daemon.returncode == 0
    (line,) = (each for each in log.splitlines() if "cycles are less punctual on this system" in each)
    assert "real-time priority (SCHED_FIFO)" in line
    assert "short timer slack (prctl)" in line
    assert "Traceback" not in log

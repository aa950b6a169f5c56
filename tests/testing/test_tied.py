"""A process that a command or a fixture starts for itself ends with it, also where that is killed."""

import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

GONE_WITHIN_S, LOOK_EVERY_S = 60.0, 0.02
BY_A_COMMAND = """
import os, signal
from pathlib import Path
import psutil
from positioner.cli.parts.children import running

with running("metrics", Path("daemon.toml"), "--listen-port", "0"):
    print(*(each.pid for each in psutil.Process().children()), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""
BY_A_FIXTURE = """
import os, signal
from pathlib import Path
import psutil
from positioner.testing.handles import slave_running

with slave_running(Path(), 0.1016, lockstep=True) as slave:
    slave.read()
    print(*(each.pid for each in psutil.Process().children()), flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""
DAEMON = """
[valve]
stroke_m = 0.1
[device]
host = "127.0.0.1"
"""


@pytest.mark.parametrize(("who", "children"), [(BY_A_COMMAND, 1), (BY_A_FIXTURE, 2)], ids=["command", "fixture"])
def test_a_process_ends_with_whoever_was_killed_that_had_started_it(who: str, children: int, tmp_path: Path) -> None:
    (tmp_path / "daemon.toml").write_text(DAEMON)
    (tmp_path / "slave.toml").write_text('valve = "seed"\n')
    done = subprocess.run([sys.executable, "-c", who], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    end_s = time.monotonic() + GONE_WITHIN_S
    started = [int(each) for each in done.stdout.split()]
    assert len(started) == children
    while any(map(_runs, started)):
        assert time.monotonic() < end_s
        time.sleep(LOOK_EVERY_S)


def _runs(number: int) -> bool:
    """Whether a process has not ended, whoever is to be told of its end."""
    try:
        return bool(psutil.Process(number).status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False

"""A process that a command starts for itself ends with the command, also where that is killed."""

import subprocess
import sys
import time
from pathlib import Path

import psutil

GONE_WITHIN_S, LOOK_EVERY_S = 60.0, 0.02
KILLED = """
import os, signal
from pathlib import Path
import psutil
from positioner.cli.parts.children import running

with running("metrics", Path("daemon.toml"), "--listen-port", "0"):
    (server,) = psutil.Process().children()
    print(server.pid, flush=True)
    os.kill(os.getpid(), signal.SIGKILL)
"""
DAEMON = """
[valve]
stroke_m = 0.1
[device]
host = "127.0.0.1"
"""


def test_a_process_ends_with_the_command_that_was_killed(tmp_path: Path) -> None:
    (tmp_path / "daemon.toml").write_text(DAEMON)
    done = subprocess.run([sys.executable, "-c", KILLED], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    end_s = time.monotonic() + GONE_WITHIN_S
    while _runs(int(done.stdout)):
        assert time.monotonic() < end_s
        time.sleep(LOOK_EVERY_S)


def _runs(number: int) -> bool:
    """Whether a process has not ended, whoever is to be told of its end."""
    try:
        return bool(psutil.Process(number).status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False

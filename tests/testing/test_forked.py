"""Processes that are forked off one: they end as they are told to, and with whoever asked for them."""

import subprocess
import sys
import time
from pathlib import Path

import psutil

ASKS = """
import os, signal, sys
from pathlib import Path
from positioner.testing.child_process import ChildProcess

def wire(log):
    return ChildProcess("positioner.testing.fault_proxy", "1", log=Path(log), forked=True)

killed, told, left = (wire(f"{each}.log") for each in range(3))
killed.kill()
told.end()
try:
    left._process.wait(0.01)
except Exception as error:
    print(type(error).__name__, left.ask("left"), flush=True)
print(left._process._number, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_was_forked_is_killed_ended_waited_for_and_lost_with_whoever_asked(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", ASKS], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    waited, number = done.stdout.splitlines()
    assert waited == "TimeoutExpired 0"
    end_s = time.monotonic() + 60.0
    while psutil.pid_exists(int(number)):
        assert time.monotonic() < end_s
        time.sleep(0.02)

"""What ends the daemon: in a process of its own, for signals and the hook of threads are a whole process's."""

import subprocess
import sys

TRY = """
import os, signal, threading
from positioner.daemon.end_signals import ENDING, OF_TERMINALS, Endings

signal.signal(signal.SIGUSR2, signal.SIG_IGN)
endings = Endings()
for number in (*OF_TERMINALS, signal.SIGUSR2, signal.SIGWINCH):
    os.kill(os.getpid(), number)
assert not endings.came
killing = set(ENDING) - {signal.SIGUSR2}
for number in killing:
    os.kill(os.getpid(), number)
assert endings.came and endings.status == 0
print(len(endings._signals), len(killing), sorted(killing - set(endings._signals)))
def fail():
    raise ValueError("broken")
thread = threading.Thread(target=fail, name="recorder")
thread.start(); thread.join()
print(endings.status, endings.reason.split(",")[0])
"""


def test_every_signal_that_kills_is_caught_and_a_thread_that_dies_ends_the_daemon() -> None:
    done = subprocess.run([sys.executable, "-c", TRY], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    caught, died = done.stdout.splitlines()
    known_to_be_ignored = "[<Signals.SIGPIPE: 13>, <Signals.SIGXFSZ: 25>]"  # by the interpreter itself
    count, wanted, missing = caught.split(" ", 2)
    assert (int(wanted) - int(count), missing) == (2, known_to_be_ignored)
    assert died == "1 recorder died"
    assert "recorder died: ValueError: broken" in done.stderr

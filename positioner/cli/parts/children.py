"""Other positioner commands as processes of their own.

With -P: a `config.py` in the current folder is not taken for ours.
"""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from config.errors import InputError

END_WITHIN_S = 10.0


@contextmanager
def running(command: str, config: Path, *options: str) -> Iterator[str]:
    """Run `positioner COMMAND CONFIG` as a process; give its first line, which says that it is ready; end it at last.

    Its log goes to a file beside the config.

    Raises:
        InputError: it ended instead of getting ready; says why.
    """
    words = [sys.executable, "-P", "-m", "positioner.cli", command, str(config), *options]
    log_path = config.with_suffix(".log")
    with log_path.open("w") as log:
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=log, text=True)
    try:
        assert process.stdout is not None
        ready = process.stdout.readline().strip()
        if not ready:
            process.wait(END_WITHIN_S)
            said = log_path.read_text().strip().splitlines()
            raise InputError(str(config), f"`positioner {command}` did not start: {said[-1] if said else 'no word'}")
        yield ready
    finally:
        process.terminate()
        try:
            process.wait(END_WITHIN_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        if process.stdout is not None:
            process.stdout.close()


def port_in(ready: str) -> int:
    """Return the port at the end of a ready line."""
    return int(ready.rpartition(":")[2])

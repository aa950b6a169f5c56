"""In a process of its own: be a module, as `python -m` is, and be told to end when whoever started it is gone.

    python -P -m positioner.testing.tied MODULE WORDS

It is gone when nobody can write to the standard input any more, however it ended: a slave and a daemon whose command
was killed would run for ever. What a person starts alone is not tied.
"""

import os
import runpy
import signal
import sys
from threading import Thread

READ_BYTES = 1024  # bytes


def main(module: str) -> None:
    """Be that module, until it ends or nobody is there."""
    Thread(target=_end_when_alone, args=(sys.stdin.fileno(),), daemon=True).start()
    runpy.run_module(module, run_name="__main__", alter_sys=True)


def _end_when_alone(heard: int) -> None:
    # Not by `sys.stdin`: whose lock a thread still holds, with that the interpreter does not end.
    while os.read(heard, READ_BYTES):
        pass
    os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    del sys.argv[0]
    main(sys.argv[0])

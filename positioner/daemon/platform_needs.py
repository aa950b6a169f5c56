"""What the daemon needs of a system, and what it goes without: Linux has all of it, macOS what is needed.

Needed is what keeps a valve safe: signals that end the daemon in the safe state, and locks, by which two daemons do not
undo what the other keeps of a valve. Gone without is what makes cycles punctual. Everything else of positioner needs
Python alone.
"""

import ctypes
import os
import signal

from config.errors import InputError
from config.lock_file import has_locks


def require_platform() -> None:
    """Refuse a system on which the daemon cannot keep its promises.

    Raises:
        InputError: says in one line what is missing.
    """
    lacks = []
    if not hasattr(signal, "SIGHUP"):
        lacks.append("signals that end a process in order")
    if not has_locks():
        lacks.append("locks on files")
    if lacks:
        raise InputError(
            "run",
            f"this system has no {' and no '.join(lacks)}, which the daemon needs to leave a valve in its safe state; "
            "it runs on Linux, and on macOS with less punctual cycles",
        )


def goes_without() -> list[str]:
    """Return what makes cycles punctual and this system has not."""
    libc = ctypes.CDLL(None)
    there = {
        "real-time priority (SCHED_FIFO)": hasattr(os, "sched_setscheduler"),
        "short timer slack (prctl)": hasattr(libc, "prctl"),
        "locked memory (mlockall)": hasattr(libc, "mlockall"),
    }
    return [name for name, has in there.items() if not has]

"""A lock that one process has at a time, and that ends with it: beside files which two would take from each other.

By flock on POSIX, by msvcrt on Windows. A system that has neither keeps nobody out; the daemon refuses to run there
(`positioner.daemon.platform_needs`).
"""

import os
import sys
from collections.abc import Callable
from pathlib import Path

from config.errors import InputError


def take_lock(path: Path, said: str) -> int:
    """Return the descriptor of the lock; closed, it is free.

    Args:
        path: of a file that stays, empty.
        said: of whose it is, where another process has it.

    Raises:
        InputError: another process has it.
        OSError: the file cannot be made.
    """
    lock = os.open(path, os.O_RDWR | os.O_CREAT, 0o644)
    try:
        lock_descriptor(lock, waits=False)
    except OSError:
        os.close(lock)
        raise InputError(str(path.parent), said) from None
    return lock


def lock_descriptor(descriptor: int, *, waits: bool) -> None:
    """Lock an open file until it is closed, waiting for another process or not.

    Raises:
        OSError: another process has it, or its file system has no locks.
    """
    lock = _of_the_system()
    if lock is not None:
        lock(descriptor, waits)


def has_locks() -> bool:
    """Return whether this system has locks on files."""
    return _of_the_system() is not None


def _of_the_system() -> Callable[[int, bool], None] | None:
    if sys.platform == "win32":
        import msvcrt

        return lambda descriptor, waits: msvcrt.locking(descriptor, msvcrt.LK_LOCK if waits else msvcrt.LK_NBLCK, 1)
    try:
        import fcntl
    except ImportError:
        return None
    return lambda descriptor, waits: fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))

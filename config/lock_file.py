"""A lock that one process has at a time, and that ends with it: beside files which two would take from each other."""

import fcntl
import os
from pathlib import Path

from config.errors import InputError


def locked(path: Path, said: str) -> int:
    """Return the descriptor of the lock; closed, it is free.

    Args:
        path: of a file that stays, empty.
        said: of whose it is, where another process has it.

    Raises:
        InputError: another process has it.
        OSError: the file cannot be made.
    """
    lock = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(lock)
        raise InputError(str(path.parent), said) from None
    return lock

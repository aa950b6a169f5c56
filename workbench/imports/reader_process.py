"""A file read in a process of its own, by a library that a damaged one may end by a signal, or keep for ever.

That ends this process alone, and the file is refused. For ever is known by the processor's time that it has used, where
the system counts that: a busy machine damages no file. What it read comes back as arrays, in a file that goes then.

    python -P -m MODULE FILE READ.npz LIMIT_S      is what it runs; it refuses by a line on standard error
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

try:
    import resource
except ImportError:  # Windows: there the clock on the wall decides
    resource = None  # type: ignore[assignment]

from config.errors import InputError
from workbench.imports.typed_tables import Columns

Groups = list[tuple[str, Columns]]
"""Columns of float64 by their names, of each group, by its name."""
REFUSED = 2  # exit status of a file that is refused, as of every command
LONGEST_READ_S, BYTES_A_S = 20.0, 1e6
"""Of the processor, for which it may read; more of a large file. The slowest library takes a tenth of a second for a
megabyte."""


def read_apart(path: Path, module: str, kind: str) -> Groups:
    """Return what a module reads of a file.

    Args:
        path: the file.
        module: its name; run as a program it calls `write_read`.
        kind: what the file is, as messages say it.

    Raises:
        InputError: the module refuses it, breaks down over it, or comes to no end.
    """
    with tempfile.TemporaryDirectory(prefix="positioner-read-") as folder:
        into = Path(folder) / "read.npz"
        limit_s = LONGEST_READ_S + path.stat().st_size / BYTES_A_S
        words = [sys.executable, "-P", "-m", module, str(path.absolute()), str(into), f"{limit_s:.0f}"]
        try:
            ended = subprocess.run(
                words,
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=limit_s if resource is None else None,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise _endless(path, kind, limit_s) from None
        if resource is not None and ended.returncode == -signal.SIGXCPU:
            raise _endless(path, kind, limit_s)
        if ended.returncode == REFUSED:
            raise InputError(str(path), ended.stderr.strip().rpartition("\n")[2])
        if ended.returncode:
            raise describe_damage(path, kind, f"its reader breaks down, status {ended.returncode}")
        with np.load(into) as read:
            names, *arrays = (read[each] for each in read.files)
    each = iter(arrays)
    return [(group, {name: next(each) for name in channels}) for group, channels in json.loads(str(names))]


def write_read(read: Callable[[Path], Groups], path: str, into: str, limit_s: str) -> None:
    """Read a file into another, or say why not and end: what is run in the process of its own."""
    if resource is not None:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit_s), resource.RLIM_INFINITY))
    try:
        groups = read(Path(path))
    except InputError as error:
        print(error.problem, file=sys.stderr, flush=True)
        os._exit(REFUSED)  # at once: objects of a library that were not made complain of that when they go
    names = json.dumps([(name, list(group)) for name, group in groups])
    np.savez(into, np.array(names), *(each for _, group in groups for each in group.values()))


def _endless(path: Path, kind: str, limit_s: float) -> InputError:
    return describe_damage(path, kind, f"its reader comes to no end in {limit_s:.0f} s")


def describe_damage(path: Path, kind: str, why: str) -> InputError:
    """Return what to say of a damaged file."""
    return InputError(str(path), f"is a damaged {kind} file: {why}")

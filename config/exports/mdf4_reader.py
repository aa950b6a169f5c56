"""MDF files of version 4, as loggers of test rigs write them: read by asammdf, in a process of its own.

A damaged file may end its reader by a signal, or keep it for ever (channels that follow one another in a circle): that
ends that process alone, and the file is refused. What it read comes back as arrays, in a file that is then deleted.

    python -P -m config.exports.mdf4_reader FILE READ.npz      is what it runs; it refuses by a line on standard error
"""

import json
import os
import subprocess
import sys
import tempfile
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from config.errors import InputError
from config.exports.typed_tables import NUMBERS, Columns, first_line, with_unit
from config.extras import needed
from config.plain_file import require_moderate

REFUSED = 2
LONGEST_S, BYTES_A_S = 20.0, 1e6
"""For which it may read; more of a large file. A megabyte takes it a tenth of a second."""


def mdf4_groups(path: Path) -> list[tuple[str, Columns]]:
    """Return the channels of numbers, float64, by their names with their units, of each group, by its name.

    Raises:
        InputError: it is of another version, or damaged.
        ModuleNotFoundError: asammdf is not installed; names the extra.
    """
    if find_spec("asammdf") is None:
        needed("asammdf", str(path))
    with tempfile.TemporaryDirectory(prefix="mdf4-") as folder:
        into = Path(folder) / "read.npz"
        words = [sys.executable, "-P", "-m", "config.exports.mdf4_reader", str(path.absolute()), str(into)]
        limit_s = LONGEST_S + path.stat().st_size / BYTES_A_S
        try:
            ended = subprocess.run(words, capture_output=True, text=True, timeout=limit_s, check=False)
        except subprocess.TimeoutExpired:
            raise _damaged(path, f"its reader comes to no end in {limit_s:.0f} s") from None
        if ended.returncode == REFUSED:
            raise InputError(str(path), ended.stderr.strip().rpartition("\n")[2])
        if ended.returncode:
            raise _damaged(path, f"its reader breaks down, status {ended.returncode}")
        with np.load(into) as read:
            names, *arrays = (read[each] for each in read.files)
    each = iter(arrays)
    return [(group, {name: next(each) for name in channels}) for group, channels in json.loads(str(names))]


def _damaged(path: Path, why: str) -> InputError:
    return InputError(str(path), f"is a damaged MDF file: {why}")


def _read(path: Path) -> list[tuple[str, Columns]]:
    """Read a file, here and now.

    Raises:
        InputError: as said above.
    """
    asammdf = needed("asammdf", str(path))
    try:
        with warnings.catch_warnings(action="ignore"), asammdf.MDF(path) as file:
            if not file.version.startswith("4"):
                raise InputError(str(path), f"is MDF of version {file.version}, allowed is 4: save it as MDF4")
            return [(f"group {index + 1}", _group(path, file, index)) for index in range(len(file.groups))]
    except InputError:
        raise
    except Exception as error:  # a damaged file fails anywhere in its reader
        raise _damaged(path, first_line(error)) from None


def _group(path: Path, file: Any, index: int) -> Columns:
    group = file.groups[index]
    require_moderate(path, group.channel_group.cycles_nr, len(group.channels))
    columns: Columns = {}
    for number, channel in enumerate(group.channels):
        if number == file.masters_db.get(index):
            continue
        signal = file.get(group=index, index=number)
        if signal.samples.ndim == 1 and signal.samples.dtype.kind in NUMBERS:
            columns.setdefault("time [s]", np.asarray(signal.timestamps, dtype=np.float64))
            columns[with_unit(channel.name, signal.unit or "")] = signal.samples.astype(np.float64)
    return columns


def main(path: str, into: str) -> None:
    """Read a file into another, or say why not and end."""
    try:
        groups = _read(Path(path))
    except InputError as error:
        print(error.problem, file=sys.stderr, flush=True)
        os._exit(REFUSED)  # at once: objects of asammdf that were not made complain of that when they go
    names = json.dumps([(name, list(group)) for name, group in groups])
    np.savez(into, np.array(names), *(each for _, group in groups for each in group.values()))


if __name__ == "__main__":
    main(*sys.argv[1:])

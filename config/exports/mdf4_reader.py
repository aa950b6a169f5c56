"""MDF files of version 4, as loggers of test rigs write them: read by asammdf in a process of its own.

Channels of a damaged file may follow one another in a circle, over which asammdf comes to no end.
"""

import sys
import warnings
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from config.errors import InputError
from config.exports.reader_process import Groups, damaged, read_apart, write_read
from config.exports.typed_tables import NUMBERS, Columns, first_line, with_unit
from config.extras import needed
from config.plain_file import require_moderate

KIND = "MDF"


def mdf4_groups(path: Path) -> Groups:
    """Return the channels of numbers, float64, by their names with their units, of each group, by its name.

    Raises:
        InputError: it is of another version, or damaged.
        ModuleNotFoundError: asammdf is not installed; names the extra.
    """
    if find_spec("asammdf") is None:
        needed("asammdf", str(path))
    return read_apart(path, "config.exports.mdf4_reader", KIND)


def _read(path: Path) -> Groups:
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
        raise damaged(path, KIND, first_line(error)) from None


def _group(path: Path, file: Any, index: int) -> Columns:
    group = file.groups[index]
    require_moderate(path, group.channel_group.cycles_nr, len(group.channels))
    columns: Columns = {}
    for number, channel in enumerate(group.channels):
        if number == file.masters_db.get(index):
            continue
        # By itself asammdf leaves out what is invalid of each channel: its rows would no longer be those of the others.
        signal = file.get(group=index, index=number, ignore_invalidation_bits=True)
        if signal.samples.ndim == 1 and signal.samples.dtype.kind in NUMBERS:
            columns.setdefault("time [s]", np.asarray(signal.timestamps, dtype=np.float64))
            values = signal.samples.astype(np.float64)
            if signal.invalidation_bits is not None:
                values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
            columns[with_unit(channel.name, signal.unit or "")] = values
    return columns


if __name__ == "__main__":
    write_read(_read, *sys.argv[1:])

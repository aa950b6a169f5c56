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
from config.extras import import_extra
from config.plain_file import require_moderate
from workbench.imports.reader_process import Groups, describe_damage, read_apart, write_read
from workbench.imports.typed_tables import NUMBERS, Columns, first_line, with_unit

KIND = "MDF"
OF_TIME = (0, 1)
"""What MDF says of a master that is a time, or of which it says nothing; 2 is an angle, 3 a distance, 4 an index."""


def mdf4_groups(path: Path) -> Groups:
    """Return the channels of numbers, float64, by their names with their units, of each group, by its name.

    Raises:
        InputError: it is of another version, or damaged.
        ModuleNotFoundError: asammdf is not installed; names the extra.
    """
    if find_spec("asammdf") is None:
        import_extra("asammdf", str(path))
    return read_apart(path, "workbench.imports.mdf4_reader", KIND)


def read_here(path: Path) -> Groups:
    """Read a file, here and now.

    Raises:
        InputError: as said above.
    """
    asammdf = import_extra("asammdf", str(path))
    try:
        with warnings.catch_warnings(action="ignore"), asammdf.MDF(path) as file:
            if not file.version.startswith("4"):
                raise InputError(str(path), f"is MDF of version {file.version}, allowed is 4: save it as MDF4")
            return [(f"group {index + 1}", _group(path, file, index)) for index in range(len(file.groups))]
    except InputError:
        raise
    except Exception as error:  # a damaged file fails anywhere in its reader
        raise describe_damage(path, KIND, first_line(error)) from None


def _group(path: Path, file: Any, index: int) -> Columns:
    group = file.groups[index]
    require_moderate(path, group.channel_group.cycles_nr, len(group.channels))
    columns: Columns = {}
    master = file.masters_db.get(index)
    shared = "time [s]" if master is None else _of_master(group.channels[master])
    for number, channel in enumerate(group.channels):
        if number == master:
            continue
        # By itself asammdf leaves out what is invalid of each channel: its rows would no longer be those of the others.
        signal = file.get(group=index, index=number, ignore_invalidation_bits=True)
        if signal.samples.ndim == 1 and signal.samples.dtype.kind in NUMBERS:
            columns.setdefault(shared, np.asarray(signal.timestamps, dtype=np.float64))
            values = signal.samples.astype(np.float64)
            if signal.invalidation_bits is not None:
                values[np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
            columns[with_unit(channel.name, signal.unit or "")] = values
    return columns


def _of_master(channel: Any) -> str:
    """Return what the channel that all others go by is called: a time is in s, but it may be an angle or a distance."""
    return "time [s]" if channel.sync_type in OF_TIME else with_unit(channel.name, channel.unit or "")


if __name__ == "__main__":
    write_read(read_here, *sys.argv[1:])

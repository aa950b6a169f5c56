"""MATLAB files before version 7.3: read by scipy, in a process of its own.

A number of the file says how its bytes are to be understood; scipy takes it as it comes, and reads what is not its own.
"""

import sys
import warnings
from collections.abc import Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from config.extras import import_extra
from workbench.imports.reader_process import Groups, describe_damage, read_apart, write_read
from workbench.imports.typed_tables import NUMBERS, Columns, first_line, vectors_of

KIND = "MATLAB"


def matlab_columns(path: Path) -> Columns:
    """Return the vectors of a file, float64; those of structs by `name.field`, those of a matrix by `name(:,1)`.

    Raises:
        InputError: it is damaged.
        ModuleNotFoundError: scipy is not installed; names the extra.
    """
    if find_spec("scipy") is None:
        import_extra("scipy.io", str(path))
    ((_, columns),) = read_apart(path, "workbench.imports.matlab_reader", KIND)
    return columns


def read_here(path: Path) -> Groups:
    """Read a file, here and now.

    Raises:
        InputError: as said above.
    """
    io = import_extra("scipy.io", str(path))
    try:
        with warnings.catch_warnings(action="ignore"):
            found = io.loadmat(path, simplify_cells=True)
    except Exception as error:  # a damaged file fails anywhere in scipy's reader
        raise describe_damage(path, KIND, first_line(error)) from None
    return [(KIND, dict(_vectors({name: value for name, value in found.items() if not name.startswith("__")})))]


def _vectors(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _vectors(value, f"{prefix}{name}.")
        elif isinstance(value, list | np.ndarray) and all(isinstance(each, Mapping) for each in np.ravel(value)):
            # An array of structures, as Simulink's signals of a scope: each is called by its label.
            for index, each in enumerate(np.ravel(value), start=1):
                label = str(each.get("label", "")) or f"{name}({index})"
                kept = {key: entry for key, entry in each.items() if key != "dimensions"}
                only = kept.get("values")
                yield from _vectors({label: only} if isinstance(only, np.ndarray) else {label: kept}, prefix)
        elif isinstance(value, np.ndarray) and value.dtype.kind in NUMBERS and value.size > 1:
            yield from vectors_of(prefix + name, value.astype(np.float64))


if __name__ == "__main__":
    write_read(read_here, *sys.argv[1:])

"""Files of measurement systems: HDF5 and MATLAB 7.3, which is HDF5 (h5py), TDMS (nptdms), older MATLAB
(`matlab_reader`), MDF4 (`mdf4_reader`).

Each group of channels of one length is a table. A channel is named by its path, joined by points, with its unit behind
it in brackets where the file says it; a time that is not stored as numbers (TDMS' waveforms, MDF's masters) is
`time [s]`.
"""

import logging
import re
import struct
import warnings
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from config.errors import InputError
from config.extras import import_extra
from config.plain_file import require_moderate
from workbench.imports import pandas_store
from workbench.imports.matlab_reader import matlab_columns
from workbench.imports.mdf4_reader import mdf4_groups
from workbench.imports.pandas_store import text_of
from workbench.imports.raw_table import RawTable
from workbench.imports.typed_tables import (
    NUMBERS,
    Columns,
    by_length,
    column_rows,
    first_line,
    vectors_of,
    with_unit,
)

PACKING = ("_FillValue", "missing_value", "scale_factor", "add_offset")
MATLAB_4_BYTES = 20
BEGIN = "wf_start_time"
WAVEFORM = (BEGIN, "wf_start_offset", "wf_increment")
"""By what TDMS says of when the samples of a channel are."""


def is_matlab_4(begin: bytes) -> bool:
    """Return whether a file begins as one of MATLAB's level 4: a type, two sizes and the length of a name that follows.

    The type is M 1000 + O 100 + P 10 + T: M of the machine, P of the numbers, T of the matrix.
    """
    for order in "<>":
        if len(begin) < MATLAB_4_BYTES:
            return False
        kind, rows, columns, imaginary, length = struct.unpack(f"{order}5i", begin[:MATLAB_4_BYTES])
        name = begin[MATLAB_4_BYTES : MATLAB_4_BYTES + length]
        machine, numbers, matrix = kind // 1000, kind // 10 % 10, kind % 10
        if machine == "<>".index(order) and kind % 1000 < 60 and numbers < 6 and matrix < 3 and 0 < length < 64:
            named = name.endswith(b"\0") and re.fullmatch(rb"[A-Za-z]\w*\0", name)
            if named and rows > 0 and columns > 0 and imaginary in (0, 1):
                return True
    return False


def matlab(path: Path) -> list[RawTable]:
    """Return the tables that the vectors of a MATLAB file before version 7.3 make, those of one length each.

    Raises:
        InputError: it is damaged, or holds no vectors.
        ModuleNotFoundError: scipy is not installed; names the extra.
    """
    return _require_tables(path, _tables(matlab_columns(path), "vectors"))


def hdf5(path: Path) -> list[RawTable]:
    """Return the tables that the vectors of an HDF5 or MATLAB 7.3 file make, those of one length each.

    Raises:
        InputError: it is damaged, or holds no vectors.
        ModuleNotFoundError: h5py is not installed; names the extra.
    """
    h5py = import_extra("h5py", str(path))
    try:
        with h5py.File(path, "r") as file:
            columns = dict(_datasets(path, h5py, file))
    except InputError:
        raise
    except Exception as error:  # a damaged file fails anywhere in the HDF5 library
        raise InputError(str(path), f"is a damaged HDF5 file: {first_line(error)}") from None
    return _require_tables(path, _tables(columns, "vectors"))


def _datasets(path: Path, h5py: Any, group: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name in group:
        if name.startswith("#"):  # MATLAB's own
            continue
        each = group.get(name)
        if isinstance(each, h5py.Group) and pandas_store.is_frame(each):
            yield from pandas_store.columns_of(path, each)
        elif isinstance(each, h5py.Group):
            yield from _datasets(path, h5py, each, f"{prefix}{name}.")
        elif isinstance(each, h5py.Dataset) and 0 < len(each.shape) <= 2:
            require_moderate(path, max(each.shape), min(each.shape) if len(each.shape) == 2 else 1)
            yield from _channels(prefix + name, each)


def _channels(name: str, dataset: Any) -> Iterator[tuple[str, Any]]:
    """Yield the vectors of a dataset; MATLAB stores a matrix turned round."""
    kind = dataset.attrs.get("MATLAB_class")
    if dataset.dtype.names:
        table = dataset[...].ravel()
        fields = [each for each in dataset.dtype.names if table[each].dtype.kind in NUMBERS and table[each].ndim == 1]
        yield from ((f"{name}.{each}", table[each].astype(np.float64)) for each in fields)
        return
    if dataset.dtype.kind not in NUMBERS or (kind is not None and bytes(kind) in (b"char", b"cell")):
        return
    values = _unpack(dataset)
    unit = next(
        (text_of(dataset.attrs[key]) for key in ("units", "unit", "Units", "Unit") if key in dataset.attrs),
        "",
    )
    yield from (
        (with_unit(each, unit), vector) for each, vector in vectors_of(name, values if kind is None else values.T)
    )


def _unpack(dataset: Any) -> Any:
    """Return what a dataset stands for: netCDF, which is HDF5, packs numbers and marks missing ones (CF 2.5, 8.1)."""
    kept = {key: np.ravel(dataset.attrs[key]) for key in PACKING if key in dataset.attrs}
    kept = {key: value for key, value in kept.items() if value.size == 1 and value.dtype.kind in NUMBERS}
    values = np.asarray(dataset[...], dtype=np.float64)
    missing = np.isin(values, [float(kept[key][0]) for key in PACKING[:2] if key in kept])
    scale, offset = (
        float(kept[key][0]) if key in kept else usual for key, usual in zip(PACKING[2:], (1, 0), strict=True)
    )
    return np.where(missing, np.nan, values * scale + offset)


def tdms(path: Path) -> list[RawTable]:
    """Return the groups of a TDMS file.

    Raises:
        InputError: it is damaged, or holds no channels of numbers.
        ModuleNotFoundError: nptdms is not installed; names the extra.
    """
    nptdms = import_extra("nptdms", str(path))
    told = _Told()
    logging.getLogger("nptdms").handlers = [told]
    try:
        with warnings.catch_warnings(action="ignore"), path.open("rb") as data, nptdms.TdmsFile.open(data) as file:
            for group in file.groups():
                require_moderate(path, max((len(each) for each in group.channels()), default=0), len(group.channels()))
            begins = [each.properties[BEGIN] for group in file.groups() for each in group.channels() if _begins(each)]
            first = min(begins, default=None)
            groups = [(group.name, columns) for group in file.groups() for columns in _tdms_group(group, first)]
    except InputError:
        raise
    except Exception as error:  # a damaged file fails anywhere in its reader
        raise InputError(str(path), f"is a damaged TDMS file: {first_line(error)}") from None
    notes = (("torn", told.first),) if told.first else ()
    tables = [replace(table, notes=notes) for name, columns in groups for table in _tables(columns, name, name)]
    return _require_tables(path, tables)


class _Told(logging.Handler):
    """Keeps the first thing that a library complains of."""

    first = ""

    def emit(self, record: logging.LogRecord) -> None:
        self.first = self.first or " ".join(record.getMessage().split())


def _begins(channel: Any) -> bool:
    return isinstance(channel.properties.get(BEGIN), np.datetime64)


def _tdms_group(group: Any, first: Any) -> list[Columns]:
    """Return the channels of a group that are of one time each, from the first begin of all waveforms on.

    Waveforms may begin and go on differently.
    """
    of_times: dict[tuple[str, ...], Columns] = {}
    for channel in group.channels():
        values = channel[:]
        kept = channel.properties
        waveform = bool(kept.get("wf_increment")) and values.dtype.kind in NUMBERS
        times = tuple(str(kept.get(each)) for each in WAVEFORM) if waveform else ()
        columns = of_times.setdefault(times, {})
        if values.dtype.kind == "M":
            columns[channel.name] = [str(np.datetime_as_string(each, unit="us")) for each in values]
        elif values.dtype.kind in NUMBERS:
            if waveform:
                late_s = (kept[BEGIN] - first) / np.timedelta64(1, "us") * 1e-6 if _begins(channel) else 0.0
                columns.setdefault("time [s]", channel.time_track() + late_s)
            unit = kept.get("unit_string") or kept.get("NI_UnitDescription") or ""
            columns[with_unit(channel.name, str(unit))] = values.astype(np.float64)
    if len(of_times) == 2 and () in of_times:  # what says no time of its own goes with the one that is said
        plain = of_times.pop(())
        return [next(iter(of_times.values())) | plain]
    return list(of_times.values())


def mdf4(path: Path) -> list[RawTable]:
    """Return the channel groups of an MDF file of version 4.

    Raises:
        InputError: it is of another version, is damaged, or holds no channels of numbers.
        ModuleNotFoundError: asammdf is not installed; names the extra.
    """
    return _require_tables(
        path, [table for name, columns in mdf4_groups(path) for table in _tables(columns, name, name)]
    )


def _tables(columns: Columns, name: str, group: str = "") -> list[RawTable]:
    """Return a table for each length among columns, the longest first."""
    return [
        RawTable(f"{name}, {length} rows", "row", partial(column_rows, chosen), sheet=group, length=length)
        for length, chosen in by_length(columns)
        if length > 1
    ]


def _require_tables(path: Path, tables: list[RawTable]) -> list[RawTable]:
    if not tables:
        raise InputError(str(path), "holds no vectors of numbers; save time, position and command as vectors")
    return tables

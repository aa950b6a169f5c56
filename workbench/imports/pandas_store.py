"""Data frames in pandas' HDF5 stores, as `to_hdf` writes them: columns by their names, and the index.

    fixed    axis0 holds the names, axis1 the index, block0_items and block0_values the columns of one type, and so on
    table    one compound dataset `table`; the names of `values_block_0`, and so on, are pickled in `.._kind`

A pickle may run anything when it is read. Only the strings in it are looked at, which runs nothing.
"""

import pickletools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from config.plain_file import require_moderate
from workbench.imports.typed_tables import NUMBERS

FRAMES = (b"frame", b"frame_table")
INDEX = "index"
STAMPS = "datetime64"


def is_frame(group: Any) -> bool:
    """Return whether a group of an HDF5 file is a data frame."""
    kind = group.attrs.get("pandas_type", b"")
    return (kind if isinstance(kind, bytes) else str(kind).encode()) in FRAMES


def columns_of(path: Path, group: Any) -> Iterator[tuple[str, Any]]:
    """Yield the columns of numbers of a data frame, and its index, stamps as ISO times.

    Raises:
        InputError: more than any recording has.
        Exception: a damaged file fails anywhere.
    """
    yield from _of_table(path, group["table"]) if "table" in group else _of_blocks(path, group)


def _of_blocks(path: Path, group: Any) -> Iterator[tuple[str, Any]]:
    yield INDEX, _index(group["axis1"][...], group["axis1"].attrs)
    for block in range(int(group.attrs.get("nblocks", 0))):
        values, names = group[f"block{block}_values"], group[f"block{block}_items"][...]
        require_moderate(path, *values.shape)
        if values.dtype.kind in NUMBERS:
            stored = np.asarray(values[...])
            by_column = stored.T if stored.shape[-1] == len(names) else stored
            stamps = str(text_of(values.attrs.get("value_type", ""))).startswith(STAMPS)
            for name, column in zip(names, by_column, strict=True):
                yield text_of(name), _stamps(column, values.attrs) if stamps else column.astype(np.float64)


def _of_table(path: Path, table: Any) -> Iterator[tuple[str, Any]]:
    require_moderate(path, len(table), len(table.dtype.names))
    rows = table[...]
    for name in table.dtype.names:
        if name == INDEX:
            yield INDEX, _index(rows[name], table.attrs, "index_kind")
        elif name.startswith("values_block_") and rows[name].dtype.kind in NUMBERS:
            names = _strings(table.attrs.get(f"{name}_kind", b""))
            values = rows[name].reshape(len(rows), -1)
            for index, column in enumerate(values.T):
                yield names[index] if index < len(names) else f"{name}.{index + 1}", column.astype(np.float64)
        elif rows[name].dtype.kind in NUMBERS and rows[name].ndim == 1:  # a column that is searched by
            yield name, rows[name].astype(np.float64)


def _index(values: Any, attributes: Any, key: str = "kind") -> Any:
    kind = text_of(attributes.get(key, ""))
    return _stamps(values, attributes, kind) if kind.startswith(STAMPS) else np.asarray(values, dtype=np.float64)


def _stamps(values: Any, attributes: Any, kind: str = "") -> list[str]:
    said = kind or text_of(attributes.get("value_type", ""))
    unit = next((each for each in ("us", "ms", "ns") if f"[{each}]" in said), "ns")
    return [str(each) for each in np.asarray(values, dtype=np.int64).astype(f"datetime64[{unit}]")]


def _strings(pickled: Any) -> list[str]:
    """Return the strings of a pickled list, without running it."""
    data = bytes(pickled) if isinstance(pickled, bytes | np.bytes_) else str(pickled).encode("latin-1", "replace")
    try:
        found = [argument for _, argument, _ in pickletools.genops(data) if isinstance(argument, str)]
    except ValueError:
        return []
    return [each for each in found if each]


def text_of(value: object) -> str:
    """Return a name or an attribute of an HDF5 file as text."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)

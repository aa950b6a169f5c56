"""Tables that know numbers from words: Excel workbooks (openpyxl), Parquet (pyarrow)."""

import datetime
import warnings
import zipfile
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from config.errors import InputError
from config.extras import import_extra
from config.plain_file import require_moderate
from workbench.imports.raw_table import Cell, RawTable

Columns = dict[str, Any]
"""Vectors by the names of their columns."""
NUMBERS = "fiub"
"""Kinds of numpy's types that are numbers."""


def workbook(path: Path, sheet: str | None = None) -> list[RawTable]:
    """Return the sheets of an Excel workbook, or the one that is named.

    Raises:
        InputError: it is a damaged one or another kind of archive, or has no sheet of that name.
        ModuleNotFoundError: openpyxl is not installed; names the extra.
    """
    if not zipfile.is_zipfile(path):
        raise InputError(str(path), "begins as a workbook and is not whole: copy it again")
    try:
        with zipfile.ZipFile(path) as archive:
            names = archive.namelist()
    except Exception as error:  # its table of contents may be damaged in any way
        raise InputError(str(path), f"is a damaged workbook: {first_line(error)}") from None
    if "xl/workbook.xml" not in names:
        raise InputError(str(path), "is an archive and no Excel workbook: unpack it, or save it as .xlsx or CSV")
    openpyxl = import_extra("openpyxl", str(path))
    try:
        with warnings.catch_warnings(action="ignore"):
            book = openpyxl.load_workbook(path, read_only=True, data_only=True)
            names = [each.title for each in book.worksheets]
            book.close()
    except Exception as error:  # whatever a damaged archive makes of XML, zip and openpyxl
        raise InputError(str(path), f"is a damaged workbook: {first_line(error)}") from None
    if sheet is not None and sheet not in names:
        raise InputError("--sheet", f"{path} has no sheet {sheet!r}; it has: {', '.join(names)}")
    return [
        RawTable(f"sheet {each!r}", "row", partial(_sheet_rows, path, openpyxl, each), sheet=each)
        for each in names
        if sheet in (None, each)
    ]


def _sheet_rows(path: Path, openpyxl: Any, sheet: str) -> Iterator[tuple[int, list[Cell]]]:
    with warnings.catch_warnings(action="ignore"):
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        try:
            page = book[sheet]
            page.reset_dimensions()  # other programs write wrong ones
            for number, row in enumerate(page.iter_rows(values_only=True), start=1):
                yield number, [_cell(value) for value in row]
        except (zipfile.BadZipFile, KeyError, ValueError, SyntaxError, EOFError, OSError) as error:
            raise InputError(str(path), f"is a damaged workbook: {first_line(error)}") from None
        finally:
            book.close()


def _cell(value: object) -> Cell:
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value)
    if isinstance(value, int | float | np.number):
        return float(value)
    if isinstance(value, datetime.datetime | datetime.date | datetime.time):
        return value.isoformat()
    if isinstance(value, datetime.timedelta):
        return value.total_seconds()
    return str(value).strip()


def by_length(columns: Mapping[str, Any]) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield the lengths of columns, the longest first, and the columns of each."""
    for length in sorted({len(each) for each in columns.values()}, reverse=True):
        yield length, {name: each for name, each in columns.items() if len(each) == length}


def parquet(path: Path) -> list[RawTable]:
    """Return the table of a Parquet file.

    Raises:
        InputError: it is damaged.
        ModuleNotFoundError: pyarrow is not installed; names the extra.
    """
    reader = import_extra("pyarrow.parquet", str(path))
    try:
        declared = reader.read_metadata(path)
        require_moderate(path, declared.num_rows, declared.num_columns)
        table = reader.read_table(path)
    except InputError:
        raise
    except Exception as error:  # a damaged file fails in any of Arrow's ways
        raise InputError(str(path), f"is a damaged Parquet file: {first_line(error)}") from None
    columns = {name: [_cell(value) for value in table[name].to_pylist()] for name in table.column_names}
    return [RawTable("Parquet", "row", partial(column_rows, columns))]


def column_rows(columns: Mapping[str, Any]) -> Iterator[tuple[int, list[Cell]]]:
    """Yield the rows of columns of one length, their names first."""
    yield 1, list(columns)
    for number, row in enumerate(zip(*columns.values(), strict=True), start=2):
        yield number, list(row)


def vectors_of(name: str, values: Any) -> Iterator[tuple[str, Any]]:
    """Yield a vector by its name, or the signals of a matrix, which lie along its longer side, by MATLAB's words."""
    if values.ndim == 1 or 1 in values.shape:
        yield name, values.ravel()
    elif values.ndim == 2:
        rows = values.shape[0] < values.shape[1]
        for index, signal in enumerate(values if rows else values.T, start=1):
            yield f"{name}({index},:)" if rows else f"{name}(:,{index})", signal


def with_unit(name: str, unit: str) -> str:
    """Return a column's name with the unit that its file says, in brackets."""
    return f"{name} [{unit}]" if unit else name


def first_line(error: Exception) -> str:
    """Return what a library complains of, in one line."""
    return (str(error).splitlines() or [type(error).__name__])[0]

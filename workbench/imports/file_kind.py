"""Which kind of file it is, by its first bytes, and the tables that it may be."""

from collections.abc import Callable
from pathlib import Path

from config.errors import InputError, explain_failure
from workbench.imports import line_protocol, measurement_files, text_table, typed_tables
from workbench.imports.raw_table import RawTable

BEGIN_BYTES = 4096
"""By which the kind of a file is told."""
REFUSED = {
    b"\xd0\xcf\x11\xe0": "is a workbook of old Excel (.xls): save it as .xlsx or CSV",
    b"\x1f\x8b": "is compressed with gzip: unpack it first",
    b"BZh": "is compressed with bzip2: unpack it first",
    b"\xfd7zXZ": "is compressed with xz: unpack it first",
    b"\x28\xb5\x2f\xfd": "is compressed with Zstandard: unpack it first",
    b"7z\xbc\xaf": "is a 7-Zip archive: unpack it first",
    b"Rar!": "is a RAR archive: unpack it first",
    b"SQLite format 3\0": 'is an SQLite database: sqlite3 -header -csv FILE "select * from TABLE" > export.csv',
    b"ARROW1": "is an Arrow (Feather) file: save it as Parquet or CSV",
    b"\x93NUMPY": "is a NumPy array without names: save it as CSV, numpy.savetxt(.., delimiter=',')",
    b"%PDF": "is a PDF: export the numbers as CSV",
    b"{\\rtf": "is a document: export the numbers as CSV",
    b"\x89PNG": "is a picture: export the numbers as CSV",
    b"\xff\xd8\xff": "is a picture: export the numbers as CSV",
}
"""By its first bytes: a file that holds no table that could be read, and what to do."""


def raw_tables(path: Path, sheet: str | None = None) -> list[RawTable]:
    """Return the tables that a file may be, by what its first bytes say, whatever it is named.

    Raises:
        InputError: it cannot be read or is of no kind that holds a table; says what to do with it.
    """
    with explain_failure(path, "cannot be read"), path.open("rb") as file:
        begin = file.read(BEGIN_BYTES)
    for magic, problem in REFUSED.items():
        if begin.startswith(magic):
            raise InputError(str(path), problem)
    if begin and not begin.strip(b"\0"):
        raise InputError(str(path), "begins with zeros alone: it is damaged, or no text")
    if begin.startswith(b"PK\x03\x04"):
        return typed_tables.workbook(path, sheet)
    if reads := _of_measurements(begin):
        return _of_group(path, reads(path), sheet)
    if sheet is not None:
        raise _without_sheets(path)
    if line_protocol.is_line_protocol(begin):
        return line_protocol.line_protocol(path)
    return text_table.text_tables(path)


def _of_measurements(begin: bytes) -> Callable[[Path], list[RawTable]] | None:
    """Return what reads a file of typed vectors, by how it begins; None of another."""
    for magic, reads in (
        (b"PAR1", typed_tables.parquet),
        (b"MATLAB 5.0 MAT-file", measurement_files.matlab),
        (b"MATLAB 7.3 MAT-file", measurement_files.hdf5),
        (b"\x89HDF", measurement_files.hdf5),
        (b"TDSm", measurement_files.tdms),
        (b"MDF     ", measurement_files.mdf4),
    ):
        if begin.startswith(magic):
            return reads
    return measurement_files.matlab if measurement_files.is_matlab_4(begin) else None


def _of_group(path: Path, tables: list[RawTable], group: str | None) -> list[RawTable]:
    """Return the tables of the group that is named, or all."""
    if group is None:
        return tables
    names = ", ".join(dict.fromkeys(each.sheet for each in tables if each.sheet))
    if not names:
        raise _without_sheets(path)
    if not (chosen := [each for each in tables if each.sheet == group]):
        raise InputError("--sheet", f"{path} has no group {group!r}; it has: {names}")
    return chosen


def _without_sheets(path: Path) -> InputError:
    return InputError("--sheet", f"goes with an Excel workbook, or groups of TDMS and MDF; {path} is none of them")

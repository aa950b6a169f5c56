"""Rows of cells before anything is understood: what every kind of file is made into first.

A text is a cell's words, a number what a typed file holds as one; dates of a typed file are ISO texts. The same bytes
may be several tables: a text by each separator, a workbook by each sheet. The header decides which it is.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

Cell = str | float


@dataclass(frozen=True, slots=True)
class RawTable:
    """One reading of a file.

    Attributes:
        what: how it was taken, for people: "fields separated by ;", "sheet 'Trend'".
        place: what a row is called in messages: "line" or "row".
        rows: begins anew at the first row; each with its number, blank ones too.
        separator: between fields of a text.
        sheet: name of a workbook's sheet, or of a measurement file's group.
        ended: whether the last line of a text has its end.
        notes: what is to be told about it, by key.
        length: about how many rows there are; 0: not known before they are read.
    """

    what: str
    place: str
    rows: Callable[[], Iterator[tuple[int, list[Cell]]]]
    separator: str = ""
    sheet: str = ""
    ended: bool = True
    notes: tuple[tuple[str, str], ...] = ()
    length: int = 0

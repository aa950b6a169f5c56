"""LabVIEW's measurement files as text (.lvm): a header of the file, one of each segment, names, and samples under them.

    Separator  Tab        X_Columns  One | Multi | No        of the file, and so on to ***End_of_Header***
    Y_Unit_Label  bar  mm     X0  0  0     Delta_X  0.5  0.5   of a segment, a column a channel
    X_Value  Pressure  Stem  Comment                          the names

With X_Columns One the first column is the time, with Multi each channel has its own before it, and with No the times
are X0 + i Delta_X.
"""

from collections.abc import Iterator
from functools import partial

from workbench.imports.cell_kinds import begins_number
from workbench.imports.raw_table import Cell, RawTable
from workbench.imports.typed_tables import with_unit

BEGIN, END, TIME, COMMENT = "LabVIEW Measurement", "***End_of_Header***", "X_Value", "Comment"


def is_labview(text: str) -> bool:
    """Return whether a text is one of LabVIEW's measurement files."""
    return text.startswith(BEGIN)


def labview_table(text: str, *, ended: bool) -> RawTable:
    """Return its samples under their names with their units, the time in seconds."""
    lines = text.splitlines()
    separator = "," if any(line.startswith("Separator,Comma") for line in lines[:20]) else "\t"
    head = _head(lines[: lines.index(END)] if END in lines else lines, separator)
    date, time = (head.get(key, [""])[0].replace("/", "-").replace(",", ".") for key in ("Date", "Time"))
    notes = (("recorded", f"{date}T{time}"),) if date and time else ()
    reading = partial(_rows, lines, separator, without_time=head.get("X_Columns") == ["No"])
    return RawTable("LabVIEW measurement", "line", reading, separator, "", ended, notes, len(lines))


def _head(lines: list[str], separator: str) -> dict[str, list[str]]:
    rows = (line.split(separator) for line in lines)
    return {key.strip(): [cell.strip() for cell in cells] for key, *cells in rows if cells}


def _rows(lines: list[str], separator: str, *, without_time: bool) -> Iterator[tuple[int, list[Cell]]]:
    head: dict[str, list[str]] = {}
    named, count = False, 0
    for number, line in enumerate(lines, start=1):
        cells = [cell.strip() for cell in line.split(separator)]
        if cells[0] == TIME:
            if not named:
                yield number, list(_with_units(cells, head.get("Y_Unit_Label", [])))
            named, count = True, 0
        elif not named or (cells[0] and not begins_number(cells[0])):
            head |= _head([line], separator)
        elif any(cells):
            time = (_first(head, "X0") + count * _first(head, "Delta_X")) if without_time else cells[0]
            yield number, [time, *cells[1:]]
            count += 1


def _with_units(names: list[str], units: list[str]) -> Iterator[str]:
    left = iter(units)
    for name in names:
        unit = "s" if name == TIME else "" if name in ("", COMMENT) else next(left, "")
        yield with_unit(name, unit)


def _first(head: dict[str, list[str]], key: str) -> float:
    try:
        return float(head[key][0].replace(",", "."))
    except (KeyError, IndexError, ValueError):
        return 0.0

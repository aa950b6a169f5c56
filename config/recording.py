"""The recording format: CSV with a header row, SI units, time strictly increasing, one row a sample.

`time_s, command_pa, position_m` are required; `pressure_pa` (measured), `reference_m`, `state` and further columns
are optional. A row's command is the one in force from its time to the next row's. Lines that begin with `#` at the
top carry metadata, `# key: value`. A last line torn by a crash is left out and told as `torn`.
"""

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config.errors import InputError

REQUIRED = ("time_s", "command_pa", "position_m")

Column = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Recording:
    """Columns of equal length by name, and what was said about them."""

    columns: Mapping[str, Column]
    metadata: Mapping[str, str] = field(default_factory=dict)

    @property
    def time_s(self) -> Column:
        """Time, strictly increasing."""
        return self.columns["time_s"]

    @property
    def command_pa(self) -> Column:
        """Pressure command in force from each time to the next."""
        return self.columns["command_pa"]

    @property
    def position_m(self) -> Column:
        """Measured stem position."""
        return self.columns["position_m"]

    def __len__(self) -> int:
        return len(self.time_s)


def write_recording(path: Path, recording: Recording) -> None:
    """Write a recording as CSV; numbers keep every bit."""
    with path.open("w", newline="", encoding="utf-8") as file:
        file.writelines(f"# {key}: {value}\n" for key, value in recording.metadata.items())
        file.write(",".join(recording.columns) + "\n")
        for row in zip(*(column.tolist() for column in recording.columns.values()), strict=True):
            file.write(",".join(map(repr, row)) + "\n")


def read_recording(path: Path) -> Recording:
    """Read a recording.

    Raises:
        InputError: names file, column or line, value and what is allowed.
    """
    columns, metadata = read_table(path, REQUIRED)
    return Recording(columns, metadata)


def read_table(path: Path, required: tuple[str, ...]) -> tuple[dict[str, Column], dict[str, str]]:
    """Read the columns and the metadata of a CSV file whose `time_s` must increase strictly.

    Raises:
        InputError: the file is not there, lacks a required column, or has a bad line (named with its number).
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return _table(path, file, required)
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(str(path), f"is not a CSV file: {error}") from None


def _table(path: Path, lines: Iterator[str], required: tuple[str, ...]) -> tuple[dict[str, Column], dict[str, str]]:
    metadata: dict[str, str] = {}
    number, header = 0, ""
    for number, line in enumerate(lines, start=1):  # noqa: B007 - the number of the header line is used below
        header = line.strip()
        if not header.startswith("#"):
            break
        key, _, value = header.lstrip("# ").partition(":")
        metadata[key.strip()] = value.strip()
    names = [name.strip() for name in header.split(",")]
    missing = [name for name in required if name not in names]
    if missing:
        raise InputError(str(path), f"column {missing[0]} is missing; line {number} names: {', '.join(names)}")
    whole = _Whole(lines, len(names))
    rows = _rows(path, csv.reader(iter(whole)), names, number)
    if whole.torn:
        metadata["torn"] = f"the last line, {number + whole.count + 1}, is not whole and was left out"
    if not rows:
        raise InputError(str(path), "holds no samples")
    table = np.array(rows, dtype=np.float64)
    columns = {name: np.ascontiguousarray(table[:, index]) for index, name in enumerate(names)}
    _require_increasing_time(path, columns["time_s"], number)
    return columns, metadata


class _Whole:
    """The lines without a last one that is torn: short of values and of its end."""

    def __init__(self, lines: Iterator[str], values: int) -> None:
        self._lines = lines
        self._values = values
        self.count = 0
        self.torn = False

    def __iter__(self) -> Iterator[str]:
        for line in self._lines:
            self.torn = not line.endswith("\n") and line.count(",") < self._values - 1
            if self.torn:
                return
            self.count += 1
            yield line


def _rows(path: Path, reader: Iterator[list[str]], names: list[str], header_line: int) -> list[list[float]]:
    rows: list[list[float]] = []
    for number, cells in enumerate(reader, start=header_line + 1):
        if not cells or cells[0].lstrip().startswith("#"):
            continue
        if len(cells) != len(names):
            raise InputError(str(path), f"line {number}: {len(cells)} values, the header names {len(names)}")
        try:
            rows.append([float(cell) if cell.strip() else np.nan for cell in cells])
        except ValueError:
            bad = next(cell for cell in cells if not _is_number(cell))
            raise InputError(str(path), f"line {number}: {bad!r} is not a number") from None
    return rows


def _is_number(cell: str) -> bool:
    try:
        float(cell or "nan")
    except ValueError:
        return False
    return True


def _require_increasing_time(path: Path, time_s: Column, header_line: int) -> None:
    steps = np.diff(time_s)
    if np.isnan(time_s).any():
        raise InputError(str(path), f"time_s: sample {int(np.isnan(time_s).argmax()) + 1} is not a number")
    if (steps <= 0).any():
        index = int((steps <= 0).argmax()) + 1
        raise InputError(
            str(path),
            f"time_s must increase strictly: sample {index + 1} (about line {header_line + index + 1}) "
            f"is at {time_s[index]:g} s after {time_s[index - 1]:g} s",
        )

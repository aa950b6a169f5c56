"""The recording format: CSV with a header row, SI units, time strictly increasing, one row a sample.

`time_s, command_pa, position_m` are required; a recording of a valve behind its own positioner, of which no pressure
is known, has `reference_m`, the set point, in the place of `command_pa`. `pressure_pa` (measured), `load_n` (external
force on the stem, positive in the opening direction), `reference_m`, `state` and further columns are optional. A row's
command is the one in force from its time to the next row's. Lines that begin with `#` at the top carry metadata,
`# key: value`. A last line torn by a crash is left out and told as `torn`. A byte order mark before it all is no part
of it. Numbers beyond 1e12 either way, infinite ones too, are no measurements: they are taken as missing, which is told.
A file named `.parquet` holds the same columns; one named `.gz` is such a CSV, compressed.

A drive's recording has the names and units of its kind (`config.drive`): `command_nm, position_rad`. Where it says a
velocity and no position, that is the velocity's integral, from zero. In the program the columns have a valve's names,
and `Recording.kind` says whose they are.
"""

import csv
import gzip
import os
import zlib
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import import_module
from io import TextIOWrapper
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TextIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from config.arguments import kinds_held
from config.drive import COLUMNS, KINDS, VALVE, Kind, kind_of_columns
from config.errors import InputError
from config.plain_file import MOST_COLUMNS, require_moderate
from config.results.block import Block, Table
from config.results.result import Result
from config.whole_file import beside

if TYPE_CHECKING:
    from matplotlib.figure import Figure

REQUIRED = ("time_s", "command_pa", "position_m")
BEHIND_POSITIONER = ("time_s", "reference_m", "position_m")
"""The same where a set point takes the command's place."""
OF_DRIVES = tuple(
    ("time_s", kind.own("command_pa"), kind.own(moved))
    for kind in KINDS.values()
    if kind is not VALVE
    for moved in ("position_m", "velocity_m_per_s")
)
"""The same of drives."""
OF_FORCES, OF_CURVES = ("time_s", "pressure_pa", "position_m", "load_n"), ("branch", "pressure_pa", "position_m")
"""The same where a bench measures what the stem is moved by: over time, and in static curves."""
KIND, INTEGRATED = "drive", "position"
"""Keys of what is said of a drive's: its kind; where its position comes from."""
NOT_MEASURED = "not measured"
MOST_MEASURED = 1e12
"""In SI: what is beyond it, either way, stands for no measurement, as 3.4e38 does."""
CLOCK_STEPS_TOLERATED = 0.01
"""Part of the rows at which a clock may be set back before the time is no clock at all."""
FEW_CLOCK_STEPS = 10
"""So often it may be in however short a recording: several may have been joined."""

LONGEST_LINE, MOST_CHARACTERS = 1_000_000, 10_000_000_000
"""Of a compressed recording; of any, the longest first line."""
LONGEST_NAMED = 300
"""Characters of the names there are that a message shows."""

Column = NDArray[np.float64]
NUMBERS = "biufO"
"""Kinds of arrays that may hold numbers: times and texts do not."""


@dataclass(frozen=True, slots=True, repr=False)
class Recording(Result):
    """Columns of equal length, (n,), by name, and what was said about them.

    Raises:
        InputError: a required column is missing, one is no series of numbers or of another length, or time runs back;
            here and there a clock may have been set back, which the workbench cuts there.
    """

    columns: Mapping[str, Column]
    metadata: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not hasattr(self.columns, "items"):
            raise InputError("recording", f"allowed are columns by their names, got {self.columns!r}")
        columns = {name: _numbers(name, given) for name, given in self.columns.items()}
        _require_columns(columns)
        _require_lengths(columns)
        _require_order(columns)
        object.__setattr__(self, "columns", columns)

    @classmethod
    def of(cls, columns: Mapping[str, Column], metadata: Mapping[str, str]) -> Self:
        """Return a recording of columns that may have a drive's names; they get a valve's, and its kind is said.

        What no instrument shows becomes a missing value, and that is said.
        """
        kind = kind_of_columns(columns)
        columns, told = _as_measured(columns, [kind.own(name) for name in COLUMNS])
        metadata = {**metadata, **told}
        if kind is VALVE:
            return cls(columns, {key: each for key, each in metadata.items() if key != KIND})
        names = {kind.own(name): name for name in COLUMNS}
        named = {names.get(name, name): column for name, column in columns.items()}
        said = {**metadata, **of_kind(kind)}
        if "position_m" not in named:
            named["position_m"] = _integrate(named["time_s"], named["velocity_m_per_s"])
            said[INTEGRATED] = f"integrated from {kind.own('velocity_m_per_s')}, from zero"
        return cls(named, said)

    @property
    def kind(self) -> Kind:
        """Whose it is: its names and units."""
        return KINDS.get(self.metadata.get(KIND, ""), VALVE)

    @property
    def own_columns(self) -> dict[str, Column]:
        """The columns by the names of its kind's files."""
        return {self.kind.own(name) if name in COLUMNS else name: column for name, column in self.columns.items()}

    @property
    def time_s(self) -> Column:
        """Time, strictly increasing."""
        return self.columns["time_s"]

    @property
    def command_pa(self) -> Column:
        """Pressure command in force from each time to the next.

        Raises:
            InputError: there is none, but a set point.
        """
        if self.by_setpoint:
            raise InputError("recording", "column command_pa is missing: it has a set point, reference_m, in its place")
        return self.columns["command_pa"]

    @property
    def by_setpoint(self) -> bool:
        """Whether it is of a valve behind its own positioner: a set point, `reference_m`, and no command."""
        return "reference_m" in self.columns and "command_pa" not in self.columns

    @property
    def position_m(self) -> Column:
        """Measured stem position."""
        return self.columns["position_m"]

    @classmethod
    @kinds_held
    def read(cls, path: Path | str) -> Self:
        """Read a recording whose clock may have been set back here and there, which the workbench cuts there.

        Raises:
            InputError: names file, column or line, value and what is allowed.
        """
        columns, metadata = _read(
            Path(path), REQUIRED, CLOCK_STEPS_TOLERATED, or_required=(BEHIND_POSITIONER, *OF_DRIVES)
        )
        return cls.of(columns, metadata)

    @kinds_held
    def write(self, path: Path | str) -> None:
        """Write as CSV, or as Parquet if the file is named so; numbers keep every bit.

        Raises:
            InputError: Parquet without pyarrow.
        """
        write_recording(Path(path), self)

    def blocks(self) -> list[Block]:
        """Say how long it is, what its columns span, and what was said about it."""
        rows = [
            (name, *(_number(end) for end in _span(column)), str(int((~np.isfinite(column)).sum())))
            for name, column in self.own_columns.items()
        ]
        said = [f"{key}: {value}" for key, value in self.metadata.items()]
        return [self._length(), Table(("column", "least", "greatest", "missing"), rows), *said]

    def _length(self) -> str:
        count = len(next(iter(self.columns.values()), ()))
        if "time_s" not in self.columns or count < 2:
            return f"{count} samples"
        steps = np.diff(self.time_s)
        return f"{count} samples over {np.sum(steps[steps > 0.0]):.6g} s, {period_text(float(np.median(steps)))} apart"

    def frame_columns(self) -> Mapping[str, Column]:
        """Return the columns."""
        return self.columns

    def plot(self) -> "Figure":
        """Draw the position, and below it the command and the pressure, over time."""
        from config.results.drawing import MEASURED, MODEL, QUIET, legend, line, panels

        length, command, travel = self.kind.length, self.kind.command, self.kind.travel.word
        heights = {f"{travel}, {length.unit}": 3.0, f"{command.word}, {command.read.unit}": 1.6}
        figure, (above, below) = panels(heights, "time, s")
        time_s = self.time_s - self.time_s[0]
        if "reference_m" in self.columns:
            reference = length.factor * self.columns["reference_m"]
            line(above, time_s, reference, MODEL, "reference", drawstyle="steps-post")
        line(above, time_s, length.factor * self.position_m, MEASURED, travel)
        if "command_pa" in self.columns:
            line(below, time_s, command.read.factor * self.command_pa, QUIET, "command", drawstyle="steps-post")
        if "pressure_pa" in self.columns:
            line(below, time_s, command.read.factor * self.columns["pressure_pa"], MODEL, command.word)
        legend(above)
        legend(below)
        return figure

    def __len__(self) -> int:
        return len(self.time_s)


def period_text(period_s: float) -> str:
    """Say how far samples lie apart.

    >>> period_text(0.005), period_text(60.0)
    ('5 ms', '60 s')
    """
    return f"{period_s:.4g} s" if period_s >= 1.0 else f"{1e3 * period_s:.4g} ms"


def _require_columns(columns: Mapping[str, Column]) -> None:
    missing = [name for name in REQUIRED if name not in columns]
    if missing and not any(set(each) <= columns.keys() for each in (BEHIND_POSITIONER, OF_FORCES, OF_CURVES)):
        missing = [name for name in OF_FORCES if name not in columns] if "load_n" in columns else missing
        raise InputError("recording", f"column {missing[0]} is missing; there are: {', '.join(columns) or 'none'}")


def _require_lengths(columns: Mapping[str, Column]) -> None:
    first, count = next((name, column.size) for name, column in columns.items())
    for name, column in columns.items():
        if column.size != count:
            raise InputError("recording", f"{name} holds {column.size} values, {first} {count}")


def _require_order(columns: Mapping[str, Column]) -> None:
    if "time_s" not in columns:
        return
    time_s = columns["time_s"]
    if not np.isfinite(time_s).all():
        raise InputError("recording", f"time_s: sample {int((~np.isfinite(time_s)).argmax()) + 1} is not a number")
    back = np.flatnonzero(np.diff(time_s) <= 0.0)
    onward = time_s.size - 1 - back.size
    if back.size > max(FEW_CLOCK_STEPS, CLOCK_STEPS_TOLERATED * time_s.size) or back.size > max(onward, 0):
        at = int(back[0]) + 1
        first = f"sample {at + 1} is at {time_s[at]:.9g} s after {time_s[at - 1]:.9g} s"
        raise InputError(
            "recording", f"time_s must increase: it does not at {back.size} of {time_s.size} samples; {first}"
        )


def _numbers(name: str, given: ArrayLike) -> Column:
    """Return a column as a plain array: a series of a data frame counts by its index, a masked one keeps what it hides.

    Raises:
        InputError: it is no series of numbers.
    """
    if isinstance(given, np.ma.MaskedArray):
        given = np.ma.filled(given.astype(np.float64), np.nan)
    values = np.asarray(given)
    try:
        if values.ndim == 1 and values.dtype.kind in NUMBERS:
            return values.astype(np.float64, copy=False)
    except (TypeError, ValueError):
        pass
    raise InputError(
        "recording", f"{name}: allowed is one number a sample, NaN where none is known, got {_kind(values)}"
    )


def _kind(values: NDArray[Any]) -> str:
    return f"an array of shape {values.shape}" if values.ndim != 1 else f"values of kind {values.dtype}"


def of_kind(kind: Kind) -> dict[str, str]:
    """Return what a recording says of itself so that `Recording.kind` knows whose it is; of a valve nothing."""
    return {} if kind is VALVE else {KIND: kind.name}


def _as_measured(columns: Mapping[str, Column], names: Sequence[str]) -> tuple[dict[str, Column], dict[str, str]]:
    """Return the columns without what no instrument shows, NaN in its place, and what is to be said of it."""
    kept, said = dict(columns), []
    for name in names:
        if name not in columns or not (beyond := np.abs(columns[name]) > MOST_MEASURED).any():
            continue
        first, count = int(beyond.argmax()), int(beyond.sum())
        which = f"sample {first + 1}" if count == 1 else f"{count} samples, the first {first + 1},"
        said.append(f"{name} of {which} is {columns[name][first]:g}")
        kept[name] = np.where(beyond, np.nan, columns[name])
    allowed = f"{'; '.join(said)}: beyond {MOST_MEASURED:g} either way nothing is, taken as missing"
    return kept, {NOT_MEASURED: allowed} if said else {}


def _integrate(time_s: Column, velocity_m_per_s: Column) -> Column:
    """Return the integral of a velocity, m, by trapezia, from zero; a value that is missing counts as the one before.

    What its sensor is off by drifts.
    """
    known = np.isfinite(velocity_m_per_s)
    last = np.maximum.accumulate(np.where(known, np.arange(known.size), 0))
    held = np.where(np.isfinite(velocity_m_per_s[last]), velocity_m_per_s[last], 0.0)
    steps_m = 0.5 * (held[1:] + held[:-1]) * np.diff(time_s)
    return np.concatenate([[0.0], np.cumsum(steps_m)])


def _span(column: Column) -> tuple[float, float]:
    """Return the least and the greatest number; NaN where there is none."""
    finite = column[np.isfinite(column)]
    return (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)


def _number(value: float) -> str:
    """Say a number in six digits, but whole before the point where it has up to twelve: a time of today has ten."""
    return f"{value:.0f}" if 1e6 <= abs(value) < 1e12 else f"{value:.6g}"


OTHER_FORMATS = frozenset(
    [
        ".arrow",
        ".bz2",
        ".feather",
        ".h5",
        ".hdf5",
        ".json",
        ".mat",
        ".mdf",
        ".mf4",
        ".nc",
        ".npy",
        ".npz",
        ".ods",
        ".tdms",
        ".xls",
        ".xlsx",
        ".xz",
        ".zip",
        ".zst",
    ]
)
"""Ends of names that promise another format than those a recording is written in."""


def require_recording_name(path: Path) -> None:
    """Refuse a name that promises another program a format which the file would not have.

    Raises:
        InputError: says which are written.
    """
    if path.suffix.lower() in OTHER_FORMATS:
        raise InputError(str(path), f"a recording is not written as {path.suffix}; allowed are .csv, .csv.gz, .parquet")


def write_recording(path: Path, recording: Recording) -> None:
    """Write a recording as CSV, compressed or as Parquet if the file is named so; numbers keep every bit.

    Raises:
        InputError: it is named as another format, Parquet without pyarrow, or the file cannot be written.
    """
    require_recording_name(path)
    try:
        if path.suffix == ".parquet":
            with beside(path) as new:
                _write_parquet(new, recording)
            return
        with beside(path) as new, _text_to(new, packed=path.suffix == ".gz") as file:
            file.writelines(f"# {key}: {value}\n" for key, value in recording.metadata.items())
            file.write(",".join(recording.own_columns) + "\n")
            for row in zip(*(column.tolist() for column in recording.columns.values()), strict=True):
                file.write(",".join(map(repr, row)) + "\n")
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise InputError(str(path), f"cannot be written: {reason}") from None


@contextmanager
def _text_to(path: Path, *, packed: bool) -> Iterator[TextIO]:
    """Open a CSV file to be written, compressed if need be; the same recording, the same bytes."""
    with path.open("wb") as file:
        if not packed:
            with TextIOWrapper(file, encoding="utf-8", newline="") as text:
                yield text
            return
        with (
            gzip.GzipFile("", "wb", fileobj=file, mtime=0) as zipped,
            TextIOWrapper(zipped, encoding="utf-8", newline="") as text,
        ):
            yield text


def read_recording(path: Path) -> Recording:
    """Read a recording.

    Raises:
        InputError: names file, column or line, value and what is allowed.
    """
    columns, metadata = read_table(path, REQUIRED)
    return Recording(columns, metadata)


def read_table(path: Path, required: tuple[str, ...]) -> tuple[dict[str, Column], dict[str, str]]:
    """Read the columns and the metadata of a file whose `time_s` must increase strictly.

    Raises:
        InputError: the file is not there, lacks a required column, or has a bad line (named with its number).
    """
    return _read(path, required, 0.0)


def _read(
    path: Path, required: tuple[str, ...], clock_steps: float, *, or_required: tuple[tuple[str, ...], ...] = ()
) -> tuple[dict[str, Column], dict[str, str]]:
    try:
        if path.suffix == ".parquet":
            columns, metadata = _read_parquet(path)
            first_line = 0
            _require(path, required, list(columns), "the file has", or_required)
        elif path.suffix == ".gz":
            with gzip.open(path, "rt", newline="", encoding="utf-8-sig") as packed:
                columns, metadata, first_line = _table(path, _moderate(path, packed), required, or_required)
        else:
            with path.open(newline="", encoding="utf-8-sig") as file:
                columns, metadata, first_line = _table(path, lines_of(path, file), required, or_required)
    except OSError as error:
        raise InputError(str(path), f"cannot be read: {error.strerror or error}") from None
    except (EOFError, zlib.error) as error:
        raise InputError(str(path), f"is not whole: {error}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        hint = f"; `positioner import {path}` says how to read another program's export"
        what = "no text" if isinstance(error, UnicodeDecodeError) else str(error)
        raise InputError(str(path), f"is not a CSV file of ours: {what}{hint}") from None
    if not columns["time_s"].size:
        raise InputError(str(path), "holds no samples")
    _require_increasing_time(path, columns["time_s"], first_line, clock_steps)
    return columns, metadata


def lines_of(path: Path, file: TextIO) -> Iterator[str]:
    """Return the lines of a text file.

    Raises:
        InputError: the first does not end where it must, as of a file of zeros: told before it is read whole.
    """
    first = file.readline(LONGEST_LINE)
    if len(first) == LONGEST_LINE:
        hint = f"; `positioner import {path}` says how to read another program's export"
        raise InputError(str(path), f"is not a CSV file of ours: line 1 is longer than {LONGEST_LINE} characters{hint}")
    return chain([first] if first else [], file)


def _moderate(path: Path, packed: TextIO) -> Iterator[str]:
    """Yield the lines of a compressed file, whose size on the disk says little of what comes out of it.

    Raises:
        InputError: a line that no recording has, or more than any is.
    """
    characters = 0
    while line := packed.readline(LONGEST_LINE):
        characters += len(line)
        if len(line) == LONGEST_LINE or characters > MOST_CHARACTERS:
            allowed = f"{LONGEST_LINE} characters a line and {MOST_CHARACTERS} in all"
            raise InputError(str(path), f"holds more than a recording does; allowed are {allowed}")
        yield line


def _require(
    path: Path, required: tuple[str, ...], names: list[str], where: str, or_required: tuple[tuple[str, ...], ...]
) -> None:
    missing = [name for name in required if name not in names]
    if missing and not any(set(each) <= set(names) for each in or_required):
        named = ", ".join(names)
        named = named if len(named) <= LONGEST_NAMED else f"{named[:LONGEST_NAMED]}.."
        hint = f"; of another program's export, `positioner import {path}` says how to read it"
        raise InputError(str(path), f"column {missing[0]} is missing; {where}: {named}{hint}")
    if len(names) > MOST_COLUMNS:
        raise InputError(str(path), f"{where} {len(names)} columns; allowed are {MOST_COLUMNS}")
    name, times = Counter(names).most_common(1)[0]
    if times > 1:
        raise InputError(str(path), f"column {name} stands {times} times; once is allowed")


def _table(
    path: Path, lines: Iterator[str], required: tuple[str, ...], or_required: tuple[tuple[str, ...], ...]
) -> tuple[dict[str, Column], dict[str, str], int]:
    """Return columns, metadata and the number of the header's line."""
    metadata: dict[str, str] = {}
    number, header = 0, ""
    for number, line in enumerate(lines, start=1):  # noqa: B007 - the number of the header line is used below
        header = line.strip()
        if not header:
            continue
        if not header.startswith("#"):
            break
        key, _, value = header.lstrip("# ").partition(":")
        metadata[key.strip()] = value.strip()
    if not header or header.startswith("#"):
        raise InputError(str(path), f"is empty; its first line should name the columns: {', '.join(required)}")
    if "\0" in header:
        raise csv.Error("no text")
    names = [name.strip() for name in header.split(",")]
    _require(path, required, names, f"line {number} names", or_required)
    whole = _Whole(lines, len(names))
    table = _rows(path, csv.reader(iter(whole)), names, number)
    if whole.torn:
        metadata["torn"] = f"the last line, {number + whole.count + 1}, is not whole and was left out"
    return {name: np.ascontiguousarray(table[:, index]) for index, name in enumerate(names)}, metadata, number


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


def _rows(path: Path, reader: Iterator[list[str]], names: list[str], header_line: int) -> Column:
    """Return the table, (n, names): eight bytes a value while it grows, for recordings of millions of rows."""
    values = array("d")
    for number, cells in enumerate(reader, start=header_line + 1):
        if not cells or cells[0].lstrip().startswith("#"):
            continue
        if len(cells) != len(names):
            raise InputError(str(path), f"line {number}: {len(cells)} values, the header names {len(names)}")
        try:
            values.extend(map(float, cells))
        except ValueError:
            if any(not _is_number(cell) for cell in cells):
                bad = next(cell for cell in cells if not _is_number(cell))
                raise InputError(str(path), f"line {number}: {bad!r} is not a number") from None
            # extend stops at the first empty cell: the row begins again where it began.
            del values[len(values) - len(values) % len(names) :]
            values.extend(float(cell) if cell.strip() else np.nan for cell in cells)
    return np.frombuffer(values, dtype=np.float64).reshape(-1, len(names))


def _is_number(cell: str) -> bool:
    try:
        float(cell if cell.strip() else "nan")  # `strip` takes away signs that `float` does not pass over
    except ValueError:
        return False
    return True


def _require_increasing_time(path: Path, time_s: Column, header_line: int, tolerated: float) -> None:
    if not np.isfinite(time_s).all():
        raise InputError(str(path), f"time_s: sample {int((~np.isfinite(time_s)).argmax()) + 1} is not a number")
    if (beyond := np.abs(time_s) > MOST_MEASURED).any():
        row = int(beyond.argmax())
        allowed = f"allowed are {MOST_MEASURED:g} s either way, 30 000 years"
        raise InputError(str(path), f"time_s: sample {row + 1} is at {time_s[row]:g} s; {allowed}")
    wrong = np.diff(time_s) <= 0
    if wrong.sum() > tolerated * len(time_s):
        index = int(wrong.argmax()) + 1
        raise InputError(
            str(path),
            f"time_s must increase strictly: sample {index + 1} (about line {header_line + index + 1}) "
            f"is at {time_s[index]:.15g} s after {time_s[index - 1]:.15g} s",
        )


def _write_parquet(path: Path, recording: Recording) -> None:
    arrow, parquet = _pyarrow(path)
    table = arrow.table({name: arrow.array(column) for name, column in recording.own_columns.items()})
    parquet.write_table(table.replace_schema_metadata(dict(recording.metadata)), path)


def _read_parquet(path: Path) -> tuple[dict[str, Column], dict[str, str]]:
    arrow, parquet = _pyarrow(path)
    try:
        declared = parquet.read_metadata(path)
        require_moderate(path, declared.num_rows, declared.num_columns)
        table = parquet.read_table(path)
        columns = {name: _float64(table[name]) for name in table.column_names}
    except (arrow.ArrowException, ValueError, TypeError) as error:
        raise InputError(str(path), f"is not a Parquet file of numbers: {str(error).splitlines()[0]}") from None
    said = table.schema.metadata or {}
    return columns, {key.decode(): value.decode() for key, value in said.items() if key != b"ARROW:schema"}


def _float64(column: Any) -> Column:
    return np.ascontiguousarray(column.to_numpy(), dtype=np.float64)


def _pyarrow(path: Path) -> tuple[Any, Any]:
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ModuleNotFoundError:
        raise InputError(str(path), "Parquet needs pyarrow: pip install pyarrow; or give it as CSV") from None

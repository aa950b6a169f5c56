"""The arguments with which a command takes other programs' exports in place of recordings."""

import argparse
import sys
from dataclasses import replace
from math import isfinite, nan
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import InputError
from positioner.cli.parts.progress import at_work

if TYPE_CHECKING:
    from config.recording import Recording
    from workbench.imports.export_mapping import ExportMapping

LARGE_FILE_BYTES = 50_000_000
"""Bytes of a file whose reading takes seconds."""


def add_export_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare them, and which stretch of a recording is taken."""
    parser.add_argument("--from-s", type=float, metavar="S", help="leave out samples before this time_s")
    parser.add_argument("--to-s", type=float, metavar="S", help="leave out samples after this time_s")
    export = parser.add_argument_group(
        "files of other programs, in place of recordings",
        "CSV, .xlsx, .mat, Parquet; `positioner import FILE` proposes these options",
    )
    export.add_argument(
        "--column",
        action="append",
        default=[],
        metavar="OURS=THEIRS:UNIT",
        help="read column THEIRS of the file, in UNIT, as column OURS of a recording: position_m=PV:%%; once for each "
        "column. #2 is the second column, Date+Time joins two, -%% counts from the other end",
    )
    export.add_argument(
        "--mapping", type=Path, metavar="MAP.toml", help="read these options from a file; the command line wins"
    )
    export.add_argument("--stroke-m", type=_stroke, metavar="M", help="100 %% of a position (the valve file's stroke)")
    export.add_argument(
        "--range-pa",
        type=_pressure,
        nargs=2,
        metavar=("AT0", "AT100"),
        help="pressures of 0 %% and 100 %% (20e3 100e3; a note says so)",
    )
    export.add_argument(
        "--period-s", type=_period, metavar="S", help="time between the rows of a file without a time column"
    )
    export.add_argument(
        "--decimal", choices=(".", ","), metavar="SIGN", help="decimal sign, . or , (the file's, where it is clear)"
    )
    export.add_argument(
        "--time-format",
        metavar="FORMAT",
        help='format of the dates, as "%%d.%%m.%%Y %%H:%%M:%%S"; not needed for ISO and seconds',
    )
    export.add_argument(
        "--status",
        action="append",
        default=[],
        metavar="THEIRS=GOOD,..",
        help="a status column and the words that mean good; other rows are read without values",
    )
    export.add_argument(
        "--sheet", metavar="NAME", help="sheet of a workbook, or group of TDMS or MDF, where several have the columns"
    )


def _stroke(word: str) -> float:
    """Read a stroke; `M`, as `import` proposes it, is a word for one that only a person knows."""
    return _read_number(word, "the stroke in metres, a positive number: 0.04 is 40 mm", positive=True)


def _pressure(word: str) -> float:
    """Read an end of a range; `AT0` and `AT100` are such words as well."""
    return _read_number(word, "a pressure in pascals, a number: 20e3 is 0.2 bar")


def _period(word: str) -> float:
    """Read a period; `S` is such a word as well."""
    return _read_number(word, "the time between two rows in seconds, a positive number: 0.01", positive=True)


def _read_number(word: str, what: str, *, positive: bool = False) -> float:
    """Read a number that only a person knows."""
    try:
        value = float(word)
    except ValueError:
        value = nan
    if not isfinite(value) or (positive and value <= 0.0):
        raise argparse.ArgumentTypeError(f"{word!r} must be {what}")
    return value


def export_words(arguments: argparse.Namespace) -> list[str]:
    """Return the words of these arguments, for a command that reads the same files."""
    from workbench.imports.export_mapping import option_words

    stretch = {name: getattr(arguments, name) for name in ("from_s", "to_s")}
    return [*option_words(stretch), *mapping_of(arguments).words]


def mapping_of(arguments: argparse.Namespace) -> "ExportMapping":
    """Return how exports are read: what was typed, and beside it what the file of `--mapping` says.

    Raises:
        InputError: a fault in that file.
    """
    from config.loading import validate
    from workbench.imports.export_mapping import ExportMapping, read_mapping_file

    written = {} if arguments.mapping is None else read_mapping_file(arguments.mapping).model_dump()
    typed = {name: value for name in ExportMapping.model_fields if (value := getattr(arguments, name))}
    return validate(ExportMapping, written | typed, "--column")


def read_any(path: Path, arguments: argparse.Namespace, stroke_m: float | None) -> "Recording":
    """Read a recording, or an export if columns are mapped, all of a command's by the same mapping.

    What was left out or put right, and what is odd about an export, is told on standard error, a line each.

    Raises:
        InputError: as `Recording.read` and `read_export`; an option that goes with columns without any; a stretch
            without samples.
    """
    from config.recording import Recording

    mapping = mapping_of(arguments)
    size = f", {path.stat().st_size / 1e6:.0f} MB" if path.is_file() and path.stat().st_size > LARGE_FILE_BYTES else ""
    if size:
        print(f"reading {path}{size}", file=sys.stderr, flush=True)
    if mapping.column:
        with at_work(arguments.command, f"reading {path}{size}") as progress:
            recording = mapping.read(path, stroke_m, progress)
        tell(f"positioner {arguments.command}: {path}", recording, mapping.stroke_m or stroke_m)
        return _stretch(recording, arguments)
    if mapping.words:
        raise InputError(mapping.words[0], "goes with --column; a recording is in SI units")
    with at_work(arguments.command, f"reading {path}{size}"):
        try:
            recording = Recording.read(path)
        except InputError as error:
            _refuse_loop(path, error)
            raise
    return _stretch(recording, arguments)


def _refuse_loop(path: Path, error: InputError) -> None:
    """Say of a file that lacks our columns that it is a control loop's, where it is.

    Raises:
        InputError: it is; names the command that reads it.
    """
    from workbench.imports.export_preview import preview

    if "is missing" not in error.problem:
        return
    try:
        loops = [each for each in preview(path).loops if each.position is None]
    except InputError:
        return
    if loops:
        raise InputError(
            str(path), f"this is a loop, not a stem ({loops[0].because}): `positioner loop {path}` reads it"
        ) from None


def _stretch(recording: "Recording", arguments: argparse.Namespace) -> "Recording":
    """Return the stretch of a recording that is asked for, its clock as it was."""

    if arguments.from_s is None and arguments.to_s is None:
        return recording
    from_s = -float("inf") if arguments.from_s is None else arguments.from_s
    to_s = float("inf") if arguments.to_s is None else arguments.to_s
    kept = (recording.time_s >= from_s) & (recording.time_s <= to_s)
    if not kept.any():
        raise InputError(
            "--from-s, --to-s",
            f"no sample lies between {from_s:g} and {to_s:g} s; time_s goes from {recording.time_s.min():g} to "
            f"{recording.time_s.max():g}",
        )
    return replace(recording, columns={name: column[kept] for name, column in recording.columns.items()})


def tell(who: str, recording: "Recording", stroke_m: float | None) -> None:
    """Say on standard error what was done to an export, and what is odd about it."""
    from config.recording_oddities import oddities

    for key, value in recording.metadata.items():
        if key != "imported":
            print(f"{who}: {key}: {value}", file=sys.stderr)
    for said in oddities(recording, stroke_m):
        print(f"{who}: {said}", file=sys.stderr)

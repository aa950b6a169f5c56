"""From a file to a recording, as `positioner import` does it: columns proposed, confirmed, read, the odd told."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from config.errors import InputError
from config.plausibility import oddities
from config.recording import Recording
from workbench.compare.comparison_sentences import shorten_notes
from workbench.data.record import Record, ready, require_few_samples
from workbench.imports.cell_units import SHARES
from workbench.imports.column_mapping import RANGE_PA, ExportOptions, list_units, read_mapping, read_status
from workbench.imports.export_preview import ExportPreview, preview
from workbench.imports.historian_export import read_export
from workbench.imports.own_format import own_recording

OURS = ("time_s", "position_m", "command_pa", "reference_m", "pressure_pa", "load_n")
"""Columns that a file's may be taken for."""


@dataclass(frozen=True, slots=True)
class ColumnChoice:
    """How a person says that an export is read."""

    columns: Mapping[str, str]
    """Theirs by ours, `NAME:UNIT` or `NAME`; what is empty is not read."""
    stroke_m: float | None = None
    time_format: str = ""
    decimal: str = ""
    range_pa: tuple[float, float] | None = None
    """The pressures of 0 % and 100 %; None: the usual ones are assumed."""
    period_s: float | None = None
    """Between the rows of a file without a time."""
    status: tuple[str, ...] = ()
    """Columns that say which rows are good, `NAME=GOOD`."""

    @property
    def named(self) -> list[str]:
        """The columns as `OURS=THEIRS:UNIT`."""
        return [f"{ours}={theirs}" for ours, theirs in self.columns.items() if theirs]

    @property
    def pressures(self) -> list[str]:
        """The pressures, of ours, that are given as a share of a range."""
        units = {ours: split_column(ours, theirs)[1].removeprefix("-") for ours, theirs in self.columns.items()}
        return [ours for ours, unit in units.items() if ours.endswith("_pa") and unit in SHARES]

    @property
    def ends_pa(self) -> tuple[float, float] | None:
        """The pressures of 0 % and 100 % as they are read; None where none is a share."""
        return (self.range_pa or RANGE_PA) if self.pressures else None

    @property
    def words(self) -> tuple[str, ...]:
        """The same as words of a command line."""
        words = [word for each in self.named for word in ("--column", each)]
        if self.stroke_m is not None:
            words += ["--stroke-m", f"{self.stroke_m:g}"]
        if self.time_format:
            words += ["--time-format", self.time_format]
        if self.ends_pa is not None:
            words += ["--range-pa", *(f"{each:g}" for each in self.ends_pa)]
        if self.period_s is not None:
            words += ["--period-s", f"{self.period_s:g}"]
        words += [word for each in self.status for word in ("--status", each)]
        return (*words, *(["--decimal", self.decimal] if self.decimal else []))


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A recording that was read, and made ready once for all: the name it came by, and where it lies."""

    name: str
    path: Path
    recording: Recording
    record: Record
    choice: ColumnChoice | None = None
    """How it was read, of an export."""
    seed: int | None = None
    """Of a blind case, what it was drawn from."""

    @classmethod
    def of(
        cls,
        name: str,
        path: Path,
        recording: Recording,
        choice: ColumnChoice | None = None,
        *,
        seed: int | None = None,
    ) -> Self:
        """Make a recording ready.

        Raises:
            InputError: as `ready`, and of more samples than may be fitted.
        """
        require_few_samples(recording)
        return cls(name, path, recording, ready(recording), choice, seed)

    @property
    def words(self) -> tuple[str, ...]:
        """What reads it on a command line, beside its name."""
        return self.choice.words if self.choice else ()


def split_column(ours: str, theirs: str) -> tuple[str, str]:
    """Return the name and the unit of a column as `NAME:UNIT` says it; the unit is empty where it says none.

    >>> split_column("position_m", "FIC:101.PV:%"), split_column("time_s", "FIC:101")
    (('FIC:101.PV', '%'), ('FIC:101', ''))
    """
    name, _, unit = theirs.rpartition(":")
    return (name, unit) if name and unit in list_units(ours) else (theirs, "")


@dataclass(frozen=True, slots=True)
class Export:
    """Another program's file: what it holds, and what is proposed."""

    name: str
    path: Path
    preview: ExportPreview
    proposed: ColumnChoice


def open_file(path: Path, name: str) -> Opened | Export:
    """Read a recording; of another program's file return what it holds.

    Raises:
        InputError: it is neither, or broken.
    """
    recording = own_recording(path)
    if recording is not None:
        return Opened.of(name, path, recording)
    found = preview(path)
    return Export(name, path, found, _read_proposal(found))


def _read_proposal(found: ExportPreview) -> ColumnChoice:
    columns, time_format, status = dict.fromkeys(OURS, ""), "", []
    for flag, word in zip(found.words, found.words[1:], strict=False):
        if flag == "--column":
            ours, _, theirs = word.partition("=")
            columns[ours] = theirs
        elif flag == "--time-format":
            time_format = word
        elif flag == "--status":
            status.append(word)
    return ColumnChoice(columns, None, time_format, status=tuple(status))


def open_file_like(path: Path, name: str, first: Opened) -> Opened:
    """Read another recording of the same valve, an export as the first was read.

    Raises:
        InputError: it is none, or not to be read so.
    """
    found = open_file(path, name)
    if isinstance(found, Opened):
        return found
    if first.choice is None:
        raise InputError(name, "is another program's file, and the recording on the desk is not: their columns differ")
    return map_export(found, first.choice)


def map_export(export: Export, by: ColumnChoice) -> Opened:
    """Read an export as a person says.

    Raises:
        InputError: a column is missing, in an unknown unit, or not to be read.
    """
    options = ExportOptions(by.decimal or None, by.time_format or None, read_status(by.status), None, by.period_s)
    sources = read_mapping(by.named, by.period_s)
    recording = read_export(export.path, sources, by.stroke_m, by.range_pa, options)
    return Opened.of(export.name, export.path, recording, by)


def wrong_with(opened: Opened, stroke_m: float | None) -> tuple[str, ...]:
    """Say what is wrong with a recording, a line each: what is odd, what was assumed, and what was left out or cut."""
    return (*oddities(opened.recording, stroke_m), *shorten_notes(opened.record.notes))

"""From a file to a recording, as `positioner import` does it: columns proposed, confirmed, read, the odd told."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from config.errors import InputError
from config.exports.column_mapping import RANGE_PA, ExportOptions, offered_units, read_mapping
from config.exports.export_preview import ExportPreview, preview
from config.exports.own_format import own_recording
from config.exports.plausibility import oddities
from config.historian_export import read_export
from config.recording import Recording
from workbench.compare.comparison_sentences import shortened
from workbench.data.record import Record, ready, require_few_samples

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

    @property
    def words(self) -> tuple[str, ...]:
        """The same as words of a command line."""
        words = [word for ours, theirs in self.columns.items() if theirs for word in ("--column", f"{ours}={theirs}")]
        if self.stroke_m is not None:
            words += ["--stroke-m", f"{self.stroke_m:g}"]
        if self.time_format:
            words += ["--time-format", self.time_format]
        return (*words, *(["--decimal", self.decimal] if self.decimal else []))


@dataclass(frozen=True, slots=True)
class Opened:
    """A recording that was read, and made ready once for all: the name it came by, and where it lies."""

    name: str
    path: Path
    recording: Recording
    record: Record
    choice: ColumnChoice | None = None
    """How it was read, of an export."""

    @classmethod
    def of(cls, name: str, path: Path, recording: Recording, choice: ColumnChoice | None = None) -> Self:
        """Make a recording ready.

        Raises:
            InputError: as `ready`, and of more samples than may be fitted.
        """
        require_few_samples(recording)
        return cls(name, path, recording, ready(recording), choice)

    @property
    def words(self) -> tuple[str, ...]:
        """What reads it on a command line, beside its name."""
        return self.choice.words if self.choice else ()


def parted(ours: str, theirs: str) -> tuple[str, str]:
    """Return the name and the unit of a column as `NAME:UNIT` says it; the unit is empty where it says none.

    >>> parted("position_m", "FIC:101.PV:%"), parted("time_s", "FIC:101")
    (('FIC:101.PV', '%'), ('FIC:101', ''))
    """
    name, _, unit = theirs.rpartition(":")
    return (name, unit) if name and unit in offered_units(ours) else (theirs, "")


@dataclass(frozen=True, slots=True)
class Export:
    """Another program's file: what it holds, and what is proposed."""

    name: str
    path: Path
    preview: ExportPreview
    proposed: ColumnChoice


def opened(path: Path, name: str) -> Opened | Export:
    """Read a recording; of another program's file return what it holds.

    Raises:
        InputError: it is neither, or broken.
    """
    recording = own_recording(path)
    if recording is not None:
        return Opened.of(name, path, recording)
    found = preview(path)
    return Export(name, path, found, _proposed(found))


def _proposed(found: ExportPreview) -> ColumnChoice:
    columns, time_format, words = dict.fromkeys(OURS, ""), "", iter(found.words)
    for flag, word in zip(words, words, strict=False):
        if flag == "--column":
            ours, _, theirs = word.partition("=")
            columns[ours] = theirs
        elif flag == "--time-format":
            time_format = word
    return ColumnChoice(columns, None, time_format)


def opened_like(path: Path, name: str, first: Opened) -> Opened:
    """Read another recording of the same valve, an export as the first was read.

    Raises:
        InputError: it is none, or not to be read so.
    """
    found = opened(path, name)
    if isinstance(found, Opened):
        return found
    if first.choice is None:
        raise InputError(name, "is another program's file, and the recording on the desk is not: their columns differ")
    return mapped(found, first.choice)


def mapped(export: Export, by: ColumnChoice) -> Opened:
    """Read an export as a person says.

    Raises:
        InputError: a column is missing, in an unknown unit, or not to be read.
    """
    chosen = [f"{ours}={theirs}" for ours, theirs in by.columns.items() if theirs]
    options = ExportOptions(by.decimal or None, by.time_format or None)
    recording = read_export(export.path, read_mapping(chosen), by.stroke_m, RANGE_PA, options)
    return Opened.of(export.name, export.path, recording, by)


def wrong_with(opened: Opened, stroke_m: float | None) -> tuple[str, ...]:
    """Say what is wrong with a recording, a line each: what is odd, and what had to be left out or cut."""
    return (*oddities(opened.recording, stroke_m), *shortened(opened.record.notes))

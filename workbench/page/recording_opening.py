"""From a file to a recording, as `positioner import` does it: columns proposed, confirmed, read, the odd told."""

from dataclasses import dataclass
from pathlib import Path
from typing import Self

from config.errors import InputError
from config.recording import Recording
from config.recording_oddities import oddities
from workbench.compare.comparison_sentences import shorten_notes
from workbench.data.record import Record, ready, require_few_samples
from workbench.imports.column_mapping import list_units
from workbench.imports.export_mapping import ExportMapping
from workbench.imports.export_preview import ExportPreview, preview
from workbench.imports.own_format import own_recording

OURS = ("time_s", "position_m", "command_pa", "reference_m", "pressure_pa", "load_n")
"""Columns that a file's may be taken for."""


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A recording that was read, and made ready once for all: the name it came by, and where it lies."""

    name: str
    path: Path
    recording: Recording
    record: Record
    choice: ExportMapping | None = None
    """How it was read, of an export."""
    seed: int | None = None
    """Of a blind case, what it was drawn from."""

    @classmethod
    def of(
        cls,
        name: str,
        path: Path,
        recording: Recording,
        choice: ExportMapping | None = None,
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
    """Another program's file, and what it holds."""

    name: str
    path: Path
    preview: ExportPreview


def open_file(path: Path, name: str) -> Opened | Export:
    """Read a recording; of another program's file return what it holds.

    Raises:
        InputError: it is neither, or broken.
    """
    recording = own_recording(path)
    if recording is not None:
        return Opened.of(name, path, recording)
    return Export(name, path, preview(path))


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


def map_export(export: Export, by: ExportMapping) -> Opened:
    """Read an export as a person says.

    Raises:
        InputError: a column is missing, in an unknown unit, or not to be read.
    """
    return Opened.of(export.name, export.path, by.read(export.path), by)


def wrong_with(opened: Opened, stroke_m: float | None) -> tuple[str, ...]:
    """Say what is wrong with a recording, a line each: what is odd, what was assumed, and what was left out or cut."""
    return (*oddities(opened.recording, stroke_m), *shorten_notes(opened.record.notes))

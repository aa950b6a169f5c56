"""The files of a daemon's recorder: their columns, and their names by valve, time and number."""

import re
from pathlib import Path

from config.file_prefix import file_stem

COLUMNS = (
    "time_s",
    "command_pa",
    "position_m",
    "pressure_pa",
    "reference_m",
    "state",
    "lost_samples",
    "unrecorded",
)


def files_of(folder: Path, name: str) -> list[Path]:
    """Return the recordings of a valve in a folder, oldest first."""
    return files_of_stem(folder, file_stem(name))


def files_of_stem(folder: Path, stem: str) -> list[Path]:
    """Return the same by what their names begin with."""
    found = all_files(folder, stem) - find_compressed_twins(folder, stem)
    return sorted(found, key=lambda each: (number_of(each), each))


def all_files(folder: Path, stem: str) -> set[Path]:
    """Return all of them, a plain file and its compressed twin both."""
    # By its whole name: a valve FV-1 must not take what belongs to a valve FV-1-A.
    mine = re.compile(re.escape(stem) + r"-\d{8}T\d{6}Z-\d+\.csv(\.gz)?")
    return {each for each in folder.iterdir() if mine.fullmatch(each.name)}


def find_compressed_twins(folder: Path, stem: str) -> set[Path]:
    """Return the plain files whose compressed twin is whole: for a moment, or after a crash, both are there."""
    found = all_files(folder, stem)
    return {each for each in found if each.with_name(f"{each.name}.gz") in found}


def number_of(file: Path) -> int:
    """Return the running number of a recording."""
    return int(file.name.partition(".csv")[0].rpartition("-")[2])

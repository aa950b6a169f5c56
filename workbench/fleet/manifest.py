"""The manifest of a fleet: one row a recording, CSV (`,` or `;`) or TOML (tables `[[recording]]`), the same four keys.

    valve       the valve's name
    file        its valve file, as seen from the manifest's folder, or the name of a shipped valve
    recording   the recording's file, as seen from there
    when        date or time, ISO 8601; with or without an offset, but all alike

What is wrong with the manifest is refused whole, before any work. A recording that is not there, or cannot be read, is
no fault of the manifest: it is listed with its reason.
"""

import csv
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date, datetime
from os.path import normpath
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, Strict, TypeAdapter, ValidationError

from config.errors import InputError
from config.loading import FolderName, Many, Schema, read_toml, validate
from config.plain_file import read_plain

KEYS = ("valve", "file", "recording", "when")


A_TIME = "must be a date or time, 2026-03-01 or 2026-03-01T14:00"


def _no_number(value: object) -> object:
    """Refuse a number, be it a text: it would count as seconds since 1970, and 20260301 be a day of that year."""
    if isinstance(value, int | float) or (isinstance(value, str) and "-" not in value):
        raise ValueError(A_TIME)
    return value


When = Annotated[
    Annotated[datetime, Strict(False)] | Annotated[date, Strict(False)],
    Field(union_mode="left_to_right"),
    BeforeValidator(_no_number),
]
WHEN: TypeAdapter[datetime | date] = TypeAdapter(When)


class Entry(Schema):
    """A recording of a valve; paths as they are written."""

    valve: FolderName
    file: FolderName
    recording: FolderName
    when: When

    @property
    def time(self) -> datetime:
        """When it was made; a date alone is its midnight."""
        return self.when if isinstance(self.when, datetime) else datetime(*self.when.timetuple()[:3])


class Entries(Schema):
    """A whole manifest."""

    recording: Many[Entry] = Field(min_length=1)


@dataclass(frozen=True, slots=True)
class Manifest:
    """The recordings by valve, each valve's in the order of their times; where the paths count from."""

    folder: Path
    valves: Mapping[str, tuple[Entry, ...]]

    @property
    def count(self) -> int:
        """How many recordings there are."""
        return sum(map(len, self.valves.values()))


def read_manifest(path: Path) -> Manifest:
    """Read a manifest.

    Raises:
        InputError: names file, key, value and what is allowed.
    """
    tables = read_toml(path) if path.suffix == ".toml" else {"recording": _rows(path)}
    entries = validate(Entries, tables, str(path)).recording
    _refuse_doubles(path, entries)
    valves: defaultdict[str, list[Entry]] = defaultdict(list)
    for entry in entries:
        valves[entry.valve].append(entry)
    ordered = {name: tuple(sorted(each, key=lambda entry: entry.time)) for name, each in valves.items()}
    return Manifest(path.parent, ordered)


def _rows(path: Path) -> list[dict[str, Any]]:
    lines = read_plain(path).splitlines()
    head = lines[0] if lines else ""
    reader = csv.DictReader(lines, delimiter=";" if ";" in head else ",")
    columns = [each.strip() for each in reader.fieldnames or ()]
    if sorted(columns) != sorted(KEYS):
        raise InputError(str(path), f"columns must be {', '.join(KEYS)}, got {', '.join(columns) or 'none'}")
    reader.fieldnames = columns
    rows: list[dict[str, Any]] = []
    for row in reader:
        rows.append({key: (row[key] or "").strip() for key in KEYS})
        when = rows[-1]["when"]
        if not _is_time(when):
            raise InputError(str(path), f"line {reader.line_num}: when: {A_TIME}, got {when or 'nothing'}")
    if not rows:
        raise InputError(str(path), "names no recording: under its first line stands a row for each")
    return rows


def _is_time(text: str) -> bool:
    try:
        WHEN.validate_python(text)
    except ValidationError:
        return False
    return True


def _refuse_doubles(path: Path, entries: Sequence[Entry]) -> None:
    if len({entry.time.tzinfo is None for entry in entries}) > 1:
        raise InputError(str(path), "when: some times have an offset and some have none; all or none must have one")
    _alike(path, entries, "file", lambda entry: entry.valve, lambda entry: normpath(entry.file), "a valve has one file")
    of_one = "it is of one valve"
    _alike(path, entries, "valve", lambda entry: normpath(entry.recording), lambda entry: entry.valve, of_one)
    seen: set[tuple[str, datetime]] = set()
    for entry in entries:
        if (entry.valve, entry.time) in seen:
            raise InputError(str(path), f"{entry.valve}: two recordings of {entry.when}; allowed is one at a time")
        seen.add((entry.valve, entry.time))


def _alike(
    path: Path,
    entries: Sequence[Entry],
    key: str,
    of: Callable[[Entry], str],
    what: Callable[[Entry], str],
    allowed: str,
) -> None:
    known: dict[str, str] = {}
    for entry in entries:
        if known.setdefault(of(entry), what(entry)) != what(entry):
            both = f"{known[of(entry)]} and {what(entry)}"
            raise InputError(str(path), f"{of(entry)}: {key} is {both}; {allowed}")

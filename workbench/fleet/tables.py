"""A fleet as tables for other programs (Parquet): valves, recordings, models. docs/fleet.md says what each column is.

They are made of the examinations alone and hold no time of their making: the same inputs, the same tables.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from config.errors import InputError
from config.extras import needed
from workbench.fleet.examination import Examination
from workbench.fleet.valve_course import ValveCourse

FIGURES = (
    "samples",
    "duration_s",
    "valid_share",
    "travel_share",
    "slips",
    "error_before_m",
    "error_after_m",
    "floor_m",
    "evidence",
    "standard_errors",
)
"""Of an examination, as they stand there."""


def write_tables(courses: Sequence[ValveCourse], folder: Path) -> None:
    """Write valves.parquet, recordings.parquet and models.parquet.

    Raises:
        InputError: the folder cannot be written.
        ModuleNotFoundError: pyarrow is not installed; names the extra.
    """
    arrow = needed("pyarrow", "positioner fleet")
    parquet = needed("pyarrow.parquet", "positioner fleet")
    tables = {"valves": valve_columns, "recordings": recording_columns, "models": model_columns}
    for name, columns in tables.items():
        path = folder / f"{name}.parquet"
        try:
            parquet.write_table(arrow.table(columns(courses)), path)
        except OSError as error:
            raise InputError(str(path), f"cannot be written: {error.strerror or error}") from None


def valve_columns(courses: Sequence[ValveCourse]) -> dict[str, list[Any]]:
    """Return a row a valve, in the order of the ranking."""
    return _columns(_valves(courses), VALVES)


def recording_columns(courses: Sequence[ValveCourse]) -> dict[str, list[Any]]:
    """Return a row a recording, valve by valve, each in the order of time."""
    return _columns(_recordings(courses), RECORDINGS)


def model_columns(courses: Sequence[ValveCourse]) -> dict[str, list[Any]]:
    """Return a row a model that was accepted, valve by valve, each in the order of time."""
    return _columns(_models(courses), MODELS)


VALVES = ("rank", "valve", "kind", "outcome", "effects", "since", "sure", "cost_share", "sentence", "recordings", "bad")
RECORDINGS = ("valve", "recording", "when", "outcome", "sentence", "effects", "rivals", "changes", *FIGURES)
MODELS = ("valve", "when", "recording", "why", "effects", "text")


def _valves(courses: Sequence[ValveCourse]) -> Iterator[Mapping[str, Any]]:
    for rank, course in enumerate(courses, start=1):
        entry, found = course.gravest or (None, Examination(outcome="as_before", sentence=""))
        yield {
            "rank": rank,
            "valve": course.name,
            "kind": course.kind,
            "outcome": found.outcome,
            "effects": ", ".join(found.effects),
            "since": entry.time.isoformat() if entry else "",
            "sure": course.sure,
            "cost_share": course.cost_share,
            "sentence": found.sentence,
            "recordings": len(course.examined),
            "bad": len(course.examined) - len(course.readable),
        }


def _recordings(courses: Sequence[ValveCourse]) -> Iterator[Mapping[str, Any]]:
    for course in courses:
        for entry, found in course.examined:
            yield {
                "valve": course.name,
                "recording": entry.recording,
                "when": entry.time.isoformat(),
                "outcome": found.outcome,
                "sentence": found.sentence,
                "effects": ", ".join(found.effects),
                "rivals": ", ".join(found.rivals),
                "changes": json.dumps({each.name: [each.before, each.now] for each in found.changes}),
                **{name: getattr(found, name) for name in FIGURES},
            }


def _models(courses: Sequence[ValveCourse]) -> Iterator[Mapping[str, Any]]:
    for course in courses:
        for each in course.models:
            yield {
                "valve": course.name,
                "when": each.when.isoformat(),
                "recording": each.recording,
                "why": each.why,
                "effects": ", ".join(each.effects),
                "text": each.text,
            }


def _columns(rows: Iterator[Mapping[str, Any]], names: Sequence[str]) -> dict[str, list[Any]]:
    listed = list(rows)
    return {name: [row[name] for row in listed] for name in names}

"""A fleet as tables for other programs (Parquet): valves, recordings, models. `TABLES` says what each column is.

The columns have the same types whatever was found; each says what it means in its field's metadata. They are made of
the examinations alone and hold no time of their making: the same inputs, the same tables.

    python -m workbench.fleet.tables

prints the columns.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from config.errors import explain_failure
from config.extras import import_extra
from config.whole_file import beside
from workbench.fleet.examination import AS_BEFORE, Examination, unreadable
from workbench.fleet.valve_complaints import Model, ValveCourse

Rows = list[Mapping[str, Any]]


@dataclass(frozen=True, slots=True)
class Column:
    """A column: its type (text, number, count, time), what it means, and its unit where it has one."""

    name: str
    kind: str
    meaning: str


ARROW = {"text": "string", "number": "float64", "count": "int64"}
VALVE = Column("valve", "text", "the valve's name in the manifest")
WHEN = Column("when", "time", "when the recording was made, as the manifest says; UTC where that has an offset")
RECORDING = Column("recording", "text", "its file, as the manifest writes it")
EFFECTS = Column("effects", "text", "what is missing in the model, joined by commas; of `one_of` one that may be")
RIVALS = Column("rivals", "text", "what explains as much")
SENTENCE = Column("sentence", "text", "the same in words")
FIGURES = (
    Column("samples", "count", "rows"),
    Column("duration_s", "number", "from first to last sample, s"),
    Column("valid_share", "number", "of the samples"),
    Column("travel_share", "number", "what the stem swept, of the stroke"),
    Column("slips", "count", "times it began to move"),
    Column("error_before_m", "number", "of the model as it was, rms, m"),
    Column("error_after_m", "number", "of the model that explains the recording best, rms, m"),
    Column("floor_m", "number", "least error of any model, rms, m"),
    Column("dead_band_share", "number", "2 F_c / k_s of that model, of the stroke"),
    Column("jump_share", "number", "(F_s - F_c) / k_s of that model, of the stroke"),
    Column("evidence", "number", "for the effect added first, of what was fitted (BIC); above 10 it counts"),
    Column("held_out_evidence", "number", "the same, of what was held out; above 6 it counts"),
)
"""Of an examination, as they stand there."""
CHANGES = Column("changes", "text", "JSON: parameter to [then, now, lower and upper end of the 95 % interval of now]")
TABLES: Mapping[str, tuple[str, tuple[Column, ...]]] = {
    "valves": (
        "a valve, in the order of the ranking",
        (
            Column("rank", "count", "1 is the gravest"),
            VALVE,
            Column("kind", "text", "what an engineer calls it; empty: nothing is wrong, as a recording shows"),
            Column("outcome", "text", "of its gravest recording, see `recordings`; unreadable: so are all of them"),
            EFFECTS,
            RIVALS,
            Column(
                "since", "time", "the first of the recordings that show it; null: nothing is wrong, or nothing known"
            ),
            Column("sure", "text", "sure, one of several, or not sure what"),
            Column(
                "cost_share",
                "number",
                "distance of the stem from where the last valid model puts it, rms, of the stroke",
            ),
            *(each for each in FIGURES if each.name in ("dead_band_share", "evidence", "held_out_evidence")),
            Column("drifting", "text", "parameters that changed more than once, always one way"),
            SENTENCE,
            Column("recordings", "count", "of the valve"),
            Column("bad", "count", "of them, could not be examined"),
        ),
    ),
    "recordings": (
        "a recording, valve by valve, in the order of time",
        (
            VALVE,
            RECORDING,
            WHEN,
            Column("outcome", "text", "as_before, changed, untold, unreadable, or a diagnosis' verdict"),
            SENTENCE,
            EFFECTS,
            RIVALS,
            CHANGES,
            *FIGURES,
        ),
    ),
    "models": (
        "a model that was accepted: the valve's journal",
        (
            VALVE,
            WHEN,
            RECORDING,
            Column("why", "text", "in words"),
            EFFECTS,
            CHANGES,
            *(each for each in FIGURES if each.name.startswith(("error", "floor", "evidence", "held_out"))),
            Column("text", "text", "the valve file"),
        ),
    ),
}


def write_tables(courses: Sequence[ValveCourse], folder: Path) -> None:
    """Write valves.parquet, recordings.parquet and models.parquet; each whole, or not at all.

    Raises:
        InputError: the folder cannot be written.
        ModuleNotFoundError: pyarrow is not installed; names the extra.
    """
    arrow = import_extra("pyarrow", "positioner fleet")
    parquet = import_extra("pyarrow.parquet", "positioner fleet")
    offset = any(entry.time.tzinfo for course in courses for entry, _ in course.examined)
    for name, (_, columns) in TABLES.items():
        path = folder / f"{name}.parquet"
        rows = ROWS[name](courses)
        schema = arrow.schema(
            [arrow.field(each.name, _type(arrow, each, offset), metadata={"meaning": each.meaning}) for each in columns]
        )
        with explain_failure(path, "cannot be written"), beside(path) as new:
            parquet.write_table(arrow.Table.from_pylist([_in_utc(row) for row in rows], schema), new)


def valve_columns(courses: Sequence[ValveCourse]) -> dict[str, list[Any]]:
    """Return a row a valve, in the order of the ranking."""
    rows = _valves(courses)
    return {each.name: [row[each.name] for row in rows] for each in TABLES["valves"][1]}


def _type(arrow: Any, column: Column, offset: bool) -> Any:
    if column.kind == "time":
        return arrow.timestamp("us", tz="UTC" if offset else None)
    return getattr(arrow, ARROW[column.kind])()


def _in_utc(row: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: value.astimezone(UTC) if isinstance(value, datetime) and value.tzinfo else value
        for name, value in row.items()
    }


def _valves(courses: Sequence[ValveCourse]) -> Rows:
    return [_valve(rank, course) for rank, course in enumerate(courses, start=1)]


WELL = Examination(outcome=AS_BEFORE, sentence="")
UNKNOWN = unreadable("none of its recordings could be examined")


def _valve(rank: int, course: ValveCourse) -> Mapping[str, Any]:
    found = course.gravest[1] if course.gravest else WELL if course.readable else UNKNOWN
    latest = next((each for _, each in reversed(course.readable)), found)
    return {
        "rank": rank,
        "valve": course.name,
        "kind": course.kind,
        **_examination_row(found),
        "since": course.since,
        "sure": course.sure,
        "cost_share": course.cost_share if course.readable else None,
        **_figures(found),
        "dead_band_share": latest.dead_band_share,
        "drifting": ", ".join(course.drifting),
        "recordings": len(course.examined),
        "bad": len(course.examined) - len(course.readable),
    }


def _recordings(courses: Sequence[ValveCourse]) -> Rows:
    return [
        {
            "valve": course.name,
            "recording": entry.recording,
            "when": entry.time,
            **_examination_row(found),
            **_figures(found),
        }
        for course in courses
        for entry, found in course.examined
    ]


def _model(course: ValveCourse, model: Model) -> Mapping[str, Any]:
    return {
        "valve": course.name,
        "when": model.when,
        "recording": model.recording,
        "why": model.found.sentence,
        **_examination_row(model.found),
        **_figures(model.found),
        "text": model.text,
    }


def _examination_row(found: Examination) -> dict[str, str]:
    changes = {each.name: [each.before, each.now, each.lower, each.upper] for each in found.changes}
    return {
        "outcome": found.outcome,
        "sentence": found.sentence,
        "effects": ", ".join(found.effects),
        "rivals": ", ".join(found.rivals),
        "changes": json.dumps(changes),
    }


def _figures(found: Examination) -> dict[str, Any]:
    return {each.name: getattr(found, each.name) for each in FIGURES}


ROWS: Mapping[str, Callable[[Sequence[ValveCourse]], Rows]] = {
    "valves": _valves,
    "recordings": _recordings,
    "models": lambda courses: [_model(course, each) for course in courses for each in course.models],
}


def columns_told() -> str:
    """Return the columns of all tables, as Markdown."""
    lines = []
    for name, (row, columns) in TABLES.items():
        lines += [f"**{name}.parquet**, a row {row}:", "", "| column | type | what it is |", "|---|---|---|"]
        lines += [f"| `{each.name}` | {each.kind} | {each.meaning} |" for each in columns]
        lines.append("")
    return "\n".join(lines)


if __name__ == "__main__":
    print(columns_told())

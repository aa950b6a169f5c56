"""What changed of the valves since a time: the model that held then against the one that holds now."""

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

from config.results.block import Block, Table
from config.writing import valve_toml
from workbench.fleet.valve_course import ValveCourse

LEAST = 0.01
"""Of a parameter: less is not told."""


@dataclass(frozen=True, slots=True)
class ModelChange:
    """A parameter, or an effect, of a valve that is another than it was; None: it was not there."""

    valve: str
    name: str
    before: float | None
    now: float | None


def changed_since(courses: Sequence[ValveCourse], time: datetime) -> list[ModelChange]:
    """Return what changed, valve by valve in the order given."""
    return [each for course in courses for each in _changes(course, time)]


def changes_told(changes: Sequence[ModelChange], time: datetime) -> list[Block]:
    """Return the changes as a table."""
    valves = {each.valve for each in changes}
    said: list[Block] = [f"since {time:%Y-%m-%d}: {len(valves)} valves have another model"]
    rows = [(each.valve, each.name, _number(each.before), _number(each.now), _percent(each)) for each in changes]
    return [*said, Table(("valve", "parameter", "then", "now", "change"), rows)] if rows else said


def _changes(course: ValveCourse, time: datetime) -> list[ModelChange]:
    if course.given is None or not course.models:
        return []
    given = valve_toml(course.given)
    before = _parameters(course.model_at(time) or given)
    now = _parameters(course.models[-1].text)
    return [
        ModelChange(course.name, name, before.get(name), now.get(name))
        for name in dict.fromkeys([*before, *now])
        if _differs(before.get(name), now.get(name))
    ]


def _parameters(text: str) -> dict[str, float]:
    tables: dict[str, Any] = tomllib.loads(text)
    found = {name: value for name, value in tables["valve"].items() if name != "name"}
    for effect in tables.get("effect", ()):
        found |= {f"{effect['name']}.{key}": value for key, value in effect.items() if key != "name"}
    return found


def _differs(before: float | None, now: float | None) -> bool:
    if before is None or now is None:
        return before is not now
    return abs(now - before) > LEAST * abs(before)


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.5g}"


def _percent(each: ModelChange) -> str:
    if not each.before or each.now is None:
        return ""
    return f"{100.0 * (each.now / each.before - 1.0):+.1f} %"

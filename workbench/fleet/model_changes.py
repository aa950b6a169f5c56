"""What changed of the valves since a time: the model that held then against the one that holds now, and new complaints.

A complaint that brought no model (one of several effects, something that nothing explains) is told beside the changes.
"""

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from config.results.block import Block, Table
from config.results.result import Result
from config.valve_file_writer import valve_toml
from workbench.fleet.examination import CHANGED
from workbench.fleet.valve_complaints import ValveCourse, complaint_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LEAST_TOLD_SHARE = 0.01
"""Of a parameter: less is not told."""
MOST_DRAWN = 40  # valves in one picture: more cannot be read
LONGEST_PERCENT = 150.0
"""What changed by more is drawn as this, with its number beside it; so is an effect that was not there."""


@dataclass(frozen=True, slots=True)
class ModelChange:
    """A parameter, or an effect's, of a valve that is another than it was; None: it was not there."""

    valve: str
    name: str
    before: float | None
    now: float | None

    @property
    def percent(self) -> float | None:
        """By how much it changed, of what it was; None: it was nothing, or is."""
        return None if not self.before or self.now is None else 100.0 * (self.now / self.before - 1.0)


@dataclass(frozen=True, slots=True)
class Complaint:
    """What a valve began to complain of, without a model that says what it is."""

    valve: str
    since: datetime
    sentence: str


@dataclass(frozen=True, slots=True, repr=False)
class ModelChanges(Result):
    """The changes, valve by valve."""

    since: datetime
    changes: tuple[ModelChange, ...]
    complaints: tuple[Complaint, ...]

    def blocks(self) -> list[Block]:
        """Say how many valves have another model, what changed, and which complain of what no model holds."""
        said: list[Block] = [
            f"since {self.since:%Y-%m-%d}: {len({each.valve for each in self.changes})} valves have another model"
        ]
        rows = [
            (each.valve, each.name, _number(each.before), _number(each.now), _percent(each), complaint_of(each.name))
            for each in self.changes
        ]
        if rows:
            said.append(Table(("valve", "parameter", "then", "now", "change", ""), rows))
        return said + [f"{each.valve}: since {each.since:%Y-%m-%d}: {each.sentence}" for each in self.complaints]

    def frame_columns(self) -> Mapping[str, list[object]]:
        """Return a row a change: valve, parameter, then and now; NaN: it was not there."""
        nothing = float("nan")
        return {
            "valve": [each.valve for each in self.changes],
            "parameter": [each.name for each in self.changes],
            "before": [nothing if each.before is None else each.before for each in self.changes],
            "now": [nothing if each.now is None else each.now for each in self.changes],
        }

    def plot(self) -> "Figure":
        """Draw by how much each parameter changed, valve by valve; an effect that is new reaches the edge."""
        from config.results.drawing import BETTER, MODEL, ROW_INCHES, panels

        drawn = self.changes[:MOST_DRAWN]
        more = f", the first {MOST_DRAWN} of {len(self.changes)}" if len(self.changes) > MOST_DRAWN else ""
        over = f"change since {self.since:%Y-%m-%d}, % of what it was{more}"
        figure, (axes,) = panels({"": 1.2 + ROW_INCHES * max(len(drawn), 1)}, over)
        for row, each in enumerate(reversed(drawn)):
            new = each.percent is None
            percent = LONGEST_PERCENT if each.percent is None else each.percent
            end = min(max(percent, -LONGEST_PERCENT), LONGEST_PERCENT)
            axes.plot([0.0, end], [row, row], color=MODEL if new else BETTER, lw=2.0)
            axes.plot(end, row, "o", color=MODEL if new else BETTER, ms=5.0)
            said = f"new: {_number(each.now)}" if new else _percent(each)
            far = end > 0.6 * LONGEST_PERCENT
            left = end < 0.0 or far
            axes.annotate(
                said,
                (end, row),
                xytext=(-8 if left else 8, 5 if far else 0),
                textcoords="offset points",
                ha="right" if left else "left",
                va="bottom" if far else "center",
                fontsize=8,
            )
        axes.axvline(0.0, color="black", lw=0.8)
        axes.set_yticks(range(len(drawn)), [f"{each.valve}  {each.name}" for each in reversed(drawn)])
        axes.set_xlim(-1.1 * LONGEST_PERCENT, 1.1 * LONGEST_PERCENT)
        axes.set_ylim(-0.7, max(len(drawn), 1) - 0.3)
        return figure


def changed_since(courses: Sequence[ValveCourse], time: datetime) -> ModelChanges:
    """Return what changed of the valves since a time, in their order."""
    complaints = [
        Complaint(course.name, entry.time, found.sentence)
        for course in courses
        for entry, found in course.complaints()
        if entry.time > time
        and found.model is None
        and found.outcome != CHANGED
        # What was seen before, too, is no change, and what is seen again not another complaint.
        and course.first_seen(entry, found) == entry.time
    ]
    return ModelChanges(time, tuple(each for course in courses for each in _changes(course, time)), tuple(complaints))


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
    return abs(now - before) > LEAST_TOLD_SHARE * abs(before)


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.5g}"


def _percent(each: ModelChange) -> str:
    return "" if each.percent is None else f"{each.percent:+.1f} %"

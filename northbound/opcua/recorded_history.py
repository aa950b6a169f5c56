"""The daemon's history for OPC UA's HistoryRead: health by the hour, identifications, events, from its SQLite file.

Of the file nothing is copied and nothing is kept here; it is opened, read and closed, also while the daemon writes.
"""

import asyncio
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

from asyncua import ua
from asyncua.common.events import Event as UaEvent
from asyncua.common.utils import ServiceError
from asyncua.server.history import HistoryStorageInterface

from config.codes import Ne107Status
from config.errors import InputError
from northbound.opcua.device_health import SEVERITY, device_health
from northbound.opcua.valve_nodes import ESTIMATES, HEALTH
from positioner.history import HistoryReader
from positioner.history.entries import Event, HealthHour, Identification

MOST_AT_ONCE = 10_000
"""Rows of an answer; the rest goes on from where it ended."""
T = TypeVar("T")
BEGINNING = datetime(1601, 1, 1, tzinfo=UTC)
"""OPC UA's, which is how clients say: no limit."""

BY_HOUR = {
    HEALTH: "ne107_worst",
    "Wear.Friction": "friction_pa",
    "Wear.FrictionBaseline": "friction_baseline_pa",
    "Wear.Reversals": "reversals",
    "Wear.StictionIndex": "stiction_index",
    "Wear.MovesJudged": "moves_judged",
    "Control.MissedPeriods": "missed_periods",
    "Control.LostSamples": "lost_samples",
    "Control.LostReplies": "lost_replies",
}
"""Columns of the hours by the nodes whose history they are, at the time when the hour began."""

BY_IDENTIFICATION = {
    f"Estimates.{ESTIMATES[each.name]}": each.name for each in fields(Identification) if each.name in ESTIMATES
}
"""The same of the identifications."""


@dataclass(frozen=True, slots=True)
class Recorded:
    """Where the history of a node is: the file, whose it is, and which node it is of; "" is the valve's events."""

    file: Path
    valve: str
    node: str
    of: ua.VariantType


class RecordedHistory(HistoryStorageInterface):  # type: ignore[misc]  # asyncua's types are skipped, see pyproject.toml
    """Reads; what asyncua would store is not stored."""

    def __init__(self, nodes: Mapping[ua.NodeId, Recorded], event_type: ua.NodeId) -> None:
        self._nodes = nodes
        self._event_type = event_type

    async def init(self) -> None:
        """Nothing to do."""

    async def stop(self) -> None:
        """Nothing to do."""

    async def read_node_history(
        self, node_id: ua.NodeId, start: datetime | None, end: datetime | None, nb_values: int
    ) -> tuple[list[ua.DataValue], datetime | None]:
        """Return the values of a stretch, and from when on to go on."""
        recorded = self._find_recorded(node_id)
        stretch = _Stretch.between(start, end)
        chosen, further = stretch.cut(await _in_a_thread(_points, recorded, stretch.since_s), nb_values)
        return [_value(time_s, value, recorded.of) for time_s, value in chosen], further

    async def read_event_history(
        self, source_id: ua.NodeId, start: datetime | None, end: datetime | None, nb_values: int, _filter: object
    ) -> tuple[list[UaEvent], datetime | None]:
        """Return the events of a stretch, and from when on to go on."""
        recorded = self._find_recorded(source_id)
        stretch = _Stretch.between(start, end)
        chosen, further = stretch.cut(await _in_a_thread(_events, recorded, stretch.since_s), nb_values)
        return [event_of(event, source_id, self._event_type) for _, event in chosen], further

    def _find_recorded(self, node_id: ua.NodeId) -> Recorded:
        if node_id not in self._nodes:
            raise ServiceError(ua.StatusCodes.BadHistoryOperationUnsupported)
        return self._nodes[node_id]


async def _in_a_thread(read: Any, recorded: Recorded, since_s: float | None) -> list[Any]:
    try:
        return list(await asyncio.to_thread(read, recorded, since_s))
    except InputError:  # it is not there yet, or is another version's: the daemon says so
        raise ServiceError(ua.StatusCodes.BadNoData) from None


def _points(recorded: Recorded, since_s: float | None) -> list[tuple[float, float]]:
    """Return times, s since 1970, and values from a time on, oldest first."""
    with HistoryReader(recorded.file) as history:
        if recorded.node in BY_HOUR:
            column = BY_HOUR[recorded.node]
            hours = history.rows(HealthHour, recorded.valve, since_s)
            return sorted((float(each.hour_s), _as_served(recorded.node, getattr(each, column))) for _, each in hours)
        column = BY_IDENTIFICATION[recorded.node]
        found = history.rows(Identification, recorded.valve, since_s)
        return sorted((each.time_s, getattr(each, column)) for _, each in found)


def _as_served(node: str, value: float) -> float:
    if node != HEALTH:
        return value
    health = device_health(value)
    return math.nan if health is None else health


def _events(recorded: Recorded, since_s: float | None) -> Iterator[tuple[float, Event]]:
    with HistoryReader(recorded.file) as history:
        events = history.events(recorded.valve, since_s)
        yield from sorted(((each.time_s, each) for each in events), key=lambda each: each[0])


@dataclass(frozen=True, slots=True)
class _Stretch:
    """What a client asks for, s since 1970; backwards if it ends before it begins or has no beginning."""

    low_s: float
    high_s: float
    backwards: bool

    @classmethod
    def between(cls, start: datetime | None, end: datetime | None) -> "_Stretch":
        begin_s, end_s = _seconds(start), _seconds(end)
        backwards = begin_s is None or (end_s is not None and end_s < begin_s)
        low_s, high_s = (end_s, begin_s) if backwards and begin_s is not None else (begin_s, end_s)
        return cls(-math.inf if low_s is None else low_s, math.inf if high_s is None else high_s, backwards)

    @property
    def since_s(self) -> float | None:
        """Its beginning; None: none."""
        return self.low_s if math.isfinite(self.low_s) else None

    def cut(self, points: list[tuple[float, T]], most: int) -> tuple[list[tuple[float, T]], datetime | None]:
        """Return what of points, oldest first, lies in it, at most so many, and where to go on."""
        chosen = [each for each in points if self.low_s <= each[0] <= self.high_s]
        if self.backwards:
            chosen.reverse()
        if most and len(chosen) > most:
            return chosen[:most], None
        if len(chosen) > MOST_AT_ONCE:
            return chosen[:MOST_AT_ONCE], _moment(chosen[MOST_AT_ONCE][0])
        return chosen, None


def _seconds(moment: datetime | None) -> float | None:
    if moment is None:
        return None
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return None if aware <= BEGINNING else aware.timestamp()


def _moment(time_s: float) -> datetime:
    return datetime.fromtimestamp(time_s, UTC)


def _value(time_s: float, value: float, of: ua.VariantType) -> ua.DataValue:
    known = not math.isnan(value)
    typed = int(value) if known and of is not ua.VariantType.Double else value
    return ua.DataValue(
        Value=ua.Variant(typed, of) if known else ua.Variant(None),
        StatusCode=ua.StatusCode(ua.StatusCodes.Good if known else ua.StatusCodes.BadNoData),
        SourceTimestamp=_moment(time_s),
        ServerTimestamp=datetime.now(UTC),
    )


def event_of(event: Event, source: ua.NodeId, event_type: ua.NodeId, emitted_by: ua.NodeId | None = None) -> UaEvent:
    """Return an event as OPC UA has it, of the valve's node; emitted by it where nobody says by which else."""
    made = UaEvent(source if emitted_by is None else emitted_by)
    severity = SEVERITY[Ne107Status(event.ne107)] if event.ne107 in list(Ne107Status) else max(SEVERITY.values())
    identity = f"{event.valve}:{event.number}".encode()
    fields: dict[str, tuple[Any, ua.VariantType]] = {
        "EventId": (identity, ua.VariantType.ByteString),
        "EventType": (event_type, ua.VariantType.NodeId),
        "SourceNode": (source, ua.VariantType.NodeId),
        "SourceName": (event.valve, ua.VariantType.String),
        "Time": (_moment(event.time_s), ua.VariantType.DateTime),
        "ReceiveTime": (_moment(event.time_s), ua.VariantType.DateTime),
        "Message": (ua.LocalizedText(event.words), ua.VariantType.LocalizedText),
        "Severity": (severity, ua.VariantType.UInt16),
        "Number": (event.number, ua.VariantType.UInt32),
        "Kind": (event.name, ua.VariantType.String),
        "Cause": (event.cause, ua.VariantType.Int32),
    }
    for name, (value, of) in fields.items():
        made.add_property(name, value, of)
    return made

"""HistoryRead out of the daemon's file: forwards, backwards, in parts, and what is not known."""

import asyncio
from dataclasses import replace
from datetime import UTC, datetime
from math import nan
from pathlib import Path

import pytest
from asyncua import ua
from asyncua.common.utils import ServiceError

from config.codes import Ne107Status
from northbound.opcua import recorded_history
from northbound.opcua.recorded_history import BEGINNING, Recorded, RecordedHistory
from tests.history.test_history_file import HOUR, event, opened

HEALTH, FRICTION, VALVE, OTHER = (ua.NodeId(name, 2) for name in ("health", "friction", "valve", "other"))
EVENT_TYPE = ua.NodeId(7, 2)


@pytest.fixture
def history(tmp_path: Path) -> RecordedHistory:
    with opened(tmp_path) as file:
        hours = [replace(HOUR, hour_s=3600 * n, friction_pa=nan if n == 3 else 100.0 * n) for n in range(1, 6)]
        hours[1] = replace(hours[1], ne107_worst=int(Ne107Status.MAINTENANCE_REQUIRED))
        file.append([*hours, *(replace(each, valve="FV 2") for each in hours)])
        file.append([event(number) for number in range(1, 4)])
    of = ua.VariantType
    return RecordedHistory(
        {
            HEALTH: Recorded(tmp_path, "FV 1", "DeviceHealth", of.Int32),
            FRICTION: Recorded(tmp_path, "FV 1", "Wear.Friction", of.Double),
            VALVE: Recorded(tmp_path, "FV 1", "", of.Null),
        },
        EVENT_TYPE,
    )


def at(hour: int) -> datetime:
    return datetime.fromtimestamp(3600 * hour, UTC)


def frictions(
    history: RecordedHistory, start: datetime | None, end: datetime | None, most: int = 0
) -> tuple[list[float | None], datetime | None]:
    values, further = asyncio.run(history.read_node_history(FRICTION, start, end, most))
    return [each.Value.Value for each in values], further


def test_a_stretch_comes_as_it_is_asked_for(history: RecordedHistory) -> None:
    assert frictions(history, at(1), at(2)) == ([100.0, 200.0], None)
    assert frictions(history, at(2), at(1)) == ([200.0, 100.0], None), "backwards"
    assert frictions(history, BEGINNING, at(2)) == ([200.0, 100.0], None), "back from the end"
    assert frictions(history, at(4), BEGINNING, 1) == ([400.0], None), "so many from the beginning"
    assert frictions(history, at(7), at(9)) == ([], None)


def test_what_is_not_known_is_no_value(history: RecordedHistory) -> None:
    (unknown,), _ = asyncio.run(history.read_node_history(FRICTION, at(3), at(3), 0))
    assert unknown.Value.Value is None
    assert unknown.StatusCode.value == ua.StatusCodes.BadNoData


def test_a_long_answer_goes_on_where_it_ended(history: RecordedHistory, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recorded_history, "MOST_AT_ONCE", 2)
    first, further = frictions(history, at(1), at(5))
    second, end = frictions(history, further, at(5))
    third, nothing = frictions(history, end, at(5))
    assert (first, second, third, nothing) == ([100.0, 200.0], [None, 400.0], [500.0], None)


def test_the_health_of_an_hour_is_in_dis_numbers(history: RecordedHistory) -> None:
    values, _ = asyncio.run(history.read_node_history(HEALTH, at(1), at(2), 0))
    assert [each.Value.Value for each in values] == [0, 4]


def test_events_have_their_fields(history: RecordedHistory) -> None:
    events, _ = asyncio.run(history.read_event_history(VALVE, None, None, 0, None))
    assert [each.Number for each in events] == [3, 2, 1]
    assert (events[0].SourceName, events[0].EventType, events[0].Severity) == ("FV 1", EVENT_TYPE, 100)
    assert events[0].Message.Text == "the mode has changed: automatic"


def test_without_a_history_or_of_another_node_there_is_none(history: RecordedHistory, tmp_path: Path) -> None:
    with pytest.raises(ServiceError) as unsupported:
        asyncio.run(history.read_node_history(OTHER, None, None, 0))
    assert unsupported.value.code == ua.StatusCodes.BadHistoryOperationUnsupported
    gone = RecordedHistory({VALVE: Recorded(tmp_path / "gone", "FV 1", "", ua.VariantType.Null)}, EVENT_TYPE)
    with pytest.raises(ServiceError) as missing:
        asyncio.run(gone.read_event_history(VALVE, None, None, 0, None))
    assert missing.value.code == ua.StatusCodes.BadNoData

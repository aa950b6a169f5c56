"""Events for subscribers: each once, in order, and none of before."""

from pathlib import Path

import pytest

from northbound.opcua.told_events import ToldEvents
from positioner.history.entries import Event


def event(number: int) -> Event:
    return Event("FV-1", number, 0.0, 7, "MODE", 0, 2, "")


@pytest.mark.parametrize(
    ("looks", "told"),
    [
        ([[1, 2, 3], [1, 2, 3], [2, 3, 4], [3, 4, 5]], [4, 5]),
        ([[], [], [1]], [1]),
        ([[5], [5, 9]], [9]),
        ([[7], [1], [1, 2]], [2]),
    ],
    ids=["in order", "from the first on", "a gap without a history", "a daemon that counts anew"],
)
def test_each_is_told_once_and_none_of_before(looks: list[list[int]], told: list[int], tmp_path: Path) -> None:
    for history in (None, tmp_path):  # one that cannot be read
        events = ToldEvents("FV-1", history)
        assert [each.number for look in looks for each in events.newer([event(n) for n in look])] == told

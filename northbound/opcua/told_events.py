"""Events for subscribers: those of a valve that are new since the last look, each told once, in their order.

Over Modbus only the newest is served: what came between two looks is taken from the daemon's history where that can be
read, and is missing otherwise, as its number shows. What was before the server looked for the first time is history.
"""

from collections.abc import Sequence
from pathlib import Path

from config.errors import InputError
from positioner.history import HistoryReader
from positioner.history.entries import Event

MOST_TOLD_EVENTS = 100
"""At a look; of more the newest."""


class ToldEvents:
    """Of one valve.

    Args:
        valve: its name.
        history: the folder of the daemon's history; None where there is none.
    """

    def __init__(self, valve: str, history: Path | None = None) -> None:
        self._valve, self._history = valve, history
        self._last: int | None = None

    def has_news(self, served: Sequence[Event]) -> bool:
        """Whether `newer` would find another newest event than at the last look."""
        return self._last is None or (bool(served) and served[-1].number != self._last)

    def newer(self, served: Sequence[Event]) -> list[Event]:
        """Return what is new, oldest first; `served` is what was read over the bus."""
        if not served:
            self._last = 0 if self._last is None else self._last
            return []
        newest, last = served[-1].number, self._last
        self._last = newest
        if last is None:
            return []
        new = [each for each in served if last < each.number <= newest]
        return self._from_history(last) or new if len(new) < newest - last else new

    def _from_history(self, last: int) -> list[Event]:
        if self._history is None:
            return []
        try:
            with HistoryReader(self._history) as history:
                return [
                    each
                    for each in history.events(self._valve, limit=MOST_TOLD_EVENTS)
                    if last < each.number <= (self._last or 0)
                ]
        except InputError:
            return []

"""What is served beside the valve's own: the newest event of its history, who asked how often, the local switch.

Earlier events: the history's file, `positioner events`, OPC UA (`recorded_history`).
"""

from collections.abc import Callable

from config.registers import REQUESTERS
from fieldbus.modbus.request_counts import RequestCounts
from positioner.control.requests import Requests
from positioner.daemon.cycle import Cycle
from positioner.daemon.snapshot import Snapshot
from positioner.history.entries import Event

Getter = Callable[[Snapshot, Requests], float]


def event_getters(cycle: Cycle) -> dict[str, Getter]:
    """Return, by register, what is served of the newest event in a snapshot."""

    def newest(of: Callable[[Event], float]) -> Getter:
        return lambda s, _: 0 if s.event is None else of(s.event)

    return {
        "event_number": newest(lambda event: event.number),
        "event": newest(lambda event: event.kind),
        "event_class": newest(lambda event: event.ne107),
        "event_cause": newest(lambda event: event.cause),
        "event_time": newest(lambda event: int(event.time_s)),
        "history_lost": lambda _s, _r: 0 if cycle.history is None else cycle.history.lost(),
    }


def site_getters(requests: RequestCounts, locked: Callable[[], bool]) -> dict[str, Getter]:
    """Return, by register, what is served of the port's requests and of the local switch."""

    def of(requester: str) -> Getter:
        return lambda _s, _r: requests.of(requester)

    return {**{f"requests_{each}": of(each) for each in REQUESTERS}, "locked_out": lambda _s, _r: locked()}

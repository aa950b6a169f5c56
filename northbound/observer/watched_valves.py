"""The valves that somebody looks at: where each one's daemon is, who polls it, and how a role connects to it."""

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from math import isfinite
from pathlib import Path

from config.daemon_file import DaemonFile
from config.errors import InputError
from config.roles import Role
from config.tls_table import Tls
from northbound.observer.poller import POLL_S, REPLY_WITHIN_S, Poller
from northbound.observer.valve_commands import ValveCommands
from northbound.observer.valve_tests import ValveTests
from northbound.observer.valve_view import ValvePicture, ValveView
from positioner.dcs import Dcs, DcsError
from positioner.history import HistoryReader
from positioner.history.entries import HealthHour

WRITE_WITHIN_S = 2.0
FRICTION_KEPT_HOURS = 720
"""A month."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a valve is served, and what its daemon's file says of it; None where nobody said."""

    name: str
    host: str
    port: int
    unit: int
    stroke_m: float | None = None
    recordings: Path | None = None
    tls: Tls | None = None
    """Of an observer."""
    tls_of: Mapping[Role, Tls] = field(default_factory=dict)
    """Of those who may write, where the daemon asks for certificates."""
    history: Path | None = None
    range_pa: tuple[float, float] | None = None
    """Of the commands."""
    settings: DaemonFile | None = None
    """The daemon's file, and"""
    file: Path | None = None
    """where it is."""

    def connection(self, role: Role) -> Dcs:
        """Return a closed connection for a role.

        Raises:
            InputError: a file of its certificate that is not there or does not fit.
            DcsError: the daemon asks for a certificate, and this role has none.
        """
        if role is Role.OBSERVER:
            return Dcs(self.host, self.port, self.unit, REPLY_WITHIN_S, self.tls)
        if self.tls is not None and role not in self.tls_of:
            raise DcsError(f"{self.name}: the page has no certificate of the role {role.name.lower()}")
        return Dcs(self.host, self.port, self.unit, WRITE_WITHIN_S, self.tls_of.get(role))


class WatchedValve:
    """One valve: polled from `start` to `stop`."""

    def __init__(self, place: Place) -> None:
        self.place = place
        self.view = _view(place)
        self.commands = ValveCommands(place.connection, self.picture)
        self.tests = ValveTests(place)
        self._poller = Poller(self.view, lambda: place.connection(Role.OBSERVER))

    def picture(self) -> ValvePicture:
        """Return what is known now."""
        return self.view.at(time.monotonic())

    def end(self) -> None:
        """Break off what moves the valve, and wait until the law has its command back."""
        self.tests.end()
        self.commands.end()

    def start(self) -> None:
        """Begin to poll."""
        self._poller.start()

    def stop(self) -> None:
        """End."""
        self._poller.stop()


def _view(place: Place) -> ValveView:
    """Return the view of a valve, with the friction of each hour of the last month that the daemon's history holds."""
    now_s = time.time()  # hours of a clock that ran ahead would keep new rows out
    off_s = now_s - time.monotonic()
    hours: list[tuple[int, HealthHour]] = []
    if place.history is not None:
        with suppress(InputError), HistoryReader(place.history) as history:
            hours = history.rows(HealthHour, place.name, limit=FRICTION_KEPT_HOURS)
    seen = [
        (hour.hour_s - off_s, hour.friction_pa, hour.friction_baseline_pa)
        for _, hour in hours
        if hour.hour_s <= now_s and isfinite(hour.friction_pa)
    ]
    return ValveView(place.name, place.stroke_m, POLL_S, seen=seen)


@contextmanager
def watching(places: Sequence[Place]) -> Iterator[list[WatchedValve]]:
    """Poll these valves as long as the context lasts.

    Raises:
        InputError: a file of a certificate that is not there or does not fit.
    """
    for place in places:
        for role in (Role.OBSERVER, *place.tls_of):
            place.connection(role)
    valves = [WatchedValve(place) for place in places]
    with ExitStack() as on_exit:
        for valve in valves:
            valve.start()
            on_exit.callback(valve.stop)
        yield valves

"""A valve as an observer knows it: what was read last, whether it is of now, the last minutes, what has changed.

Readings and failures come in with their time, s, on a clock that is never set back; `at` says what is known at a time.
One thread reads, others ask.
"""

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from threading import Lock

from config.recording import Column
from northbound.observer.freshness import Freshness, FreshnessMemory, after_failure, after_reading, freshness
from northbound.observer.register_words import code_text
from northbound.observer.trends import Trend
from northbound.observer.valve_events import SeenEvent, read_event
from positioner.history.entries import Event

TREND_S = 600.0
FRICTION_EVERY_S = 60.0
FRICTION_KEPT = 43_200
"""A month of minutes."""
FrictionRow = tuple[float, float, float]
"""Time, s, friction and its baseline, Pa."""
MOST_EVENTS = 200  # newest that are kept

WATCHED = {
    "mode": "mode",
    "fault": "fault",
    "experiment_state": "experiment",
    "restored": "restored knowledge",
}
"""Codes whose change is an event, and what they are called."""
HEALTH = frozenset(("ne107", "ne107_cause"))
"""Said together."""
COUNTED = {"identifications": "an identification was applied", "refusals": "an identification was refused"}
"""Counts whose change is one."""


@dataclass(frozen=True, slots=True)
class ValvePicture:
    """What is known of a valve at a time. `values` are of now only as far as `freshness` says."""

    name: str
    time_s: float
    freshness: Freshness
    values: Mapping[str, float]
    restarts: int
    events: tuple[SeenEvent, ...]
    """What was seen, newest first."""
    served: tuple[Event, ...] = ()
    """What the daemon says has happened, as far as it was read over the bus; oldest first."""

    def value(self, register: str) -> float:
        """Return what was read of a register last; NaN where it never was."""
        return self.values.get(register, math.nan)

    @property
    def turns(self) -> bool:
        """Whether the valve turns: its positions, in m otherwise, are rad."""
        return math.isfinite(self.value("position_deg"))

    def text(self, register: str) -> str:
        """Return what a register of a code says."""
        return code_text(register, self.value(register))


class ValveView:
    """What is known of one valve.

    Args:
        name: of the valve.
        stroke_m: travel of 1 p.u.; None where nobody said: the positions in p.u. and in m tell.
        poll_s: how far readings are apart.
        seen: rows of friction that were seen before, by the clock of the readings.
    """

    def __init__(
        self,
        name: str,
        stroke_m: float | None,
        poll_s: float,
        *,
        seen: Iterable[FrictionRow] = (),
    ) -> None:
        self.name = name
        self.poll_s = poll_s
        self._stroke_m = stroke_m
        self._memory = FreshnessMemory()
        self._values: Mapping[str, float] = {}
        self._trend = Trend(round(TREND_S / poll_s))
        self._friction: deque[FrictionRow] = deque(seen, maxlen=FRICTION_KEPT)
        self._events: deque[SeenEvent] = deque(maxlen=MOST_EVENTS)
        self._served: deque[Event] = deque(maxlen=MOST_EVENTS)
        self._lock = Lock()

    def take(self, time_s: float, values: Mapping[str, float]) -> None:
        """Take a reading of some registers, by name; the first after a failure has them all."""
        if math.isfinite(angle_deg := values.get("position_deg", math.nan)):
            values = {**values, "position_m": math.radians(angle_deg)}
        with self._lock:
            before, memory = self._values, after_reading(self._memory, time_s, values)
            self._note_connection(time_s, memory)
            self._memory = memory
            for text in _changes(before, values):
                self._events.appendleft(SeenEvent(time_s, text))
            self._values = {**before, **values}
            event = read_event(self.name, values)
            if event is not None and (not self._served or self._served[-1] != event):
                self._served.append(event)
            if "position_m" in values:
                self._enter(time_s, freshness(memory, time_s))
            if "friction" in values and time_s >= self._friction_due_s:
                self._friction.append((time_s, values["friction"], values["friction_baseline"]))

    def lose(self, time_s: float, why: str) -> None:
        """Take it that a request was not answered, and why."""
        with self._lock:
            if not self._memory.is_away:
                self._events.appendleft(SeenEvent(time_s, f"connection lost: {why}", True))
            self._memory = after_failure(self._memory, time_s, why)
            self._trend.gap(time_s)

    def at(self, now_s: float) -> ValvePicture:
        """Return what is known at a time."""
        with self._lock:
            memory = self._memory
            return ValvePicture(
                self.name,
                now_s,
                freshness(memory, now_s),
                self._values,
                memory.restarts,
                tuple(self._events),
                tuple(self._served),
            )

    def trend(self, begin_s: float) -> dict[str, Column]:
        """Return the readings after a time, as `Trend.since`."""
        with self._lock:
            return self._trend.since(begin_s)

    @property
    def friction(self) -> tuple[FrictionRow, ...]:
        """A row a minute since this began to look, and what was seen before."""
        with self._lock:
            return tuple(self._friction)

    @property
    def turns(self) -> bool:
        """Whether the valve turns; what it is in m otherwise, is then in rad."""
        return math.isfinite(self._values.get("position_deg", math.nan))

    @property
    def stroke_m(self) -> float:
        """Travel of 1 p.u., m; NaN while it is not known."""
        if self._stroke_m is not None:
            return self._stroke_m
        position, position_m = (self._values.get(name, math.nan) for name in ("position", "position_m"))
        return position_m / position if abs(position) > 0.01 else math.nan

    @property
    def _friction_due_s(self) -> float:
        return self._friction[-1][0] + FRICTION_EVERY_S if self._friction else -math.inf

    def _enter(self, time_s: float, fresh: Freshness) -> None:
        """Put a reading into the trend: of a measurement that is old, only what was decided."""
        values = self._values if fresh.measured_live else {**self._values, "position_m": math.nan, "pressure": math.nan}
        if fresh.live:
            self._trend.append(time_s, values, self.stroke_m)
        else:
            self._trend.gap(time_s)

    def _note_connection(self, time_s: float, memory: FreshnessMemory) -> None:
        if memory.restarts > self._memory.restarts:
            self._events.appendleft(SeenEvent(time_s, "the daemon has restarted", True))
        elif self._memory.is_away:
            self._events.appendleft(SeenEvent(time_s, "connected", True))


def _changes(before: Mapping[str, float], after: Mapping[str, float]) -> list[str]:
    """Return in words what has changed between two readings."""
    both = before.keys() & after.keys()
    codes = [name for name in WATCHED if name in both and before[name] != after[name]]
    said = [f"{WATCHED[name]}: {code_text(name, before[name])} -> {code_text(name, after[name])}" for name in codes]
    if both >= HEALTH and any(before[name] != after[name] for name in HEALTH):
        cause = code_text("ne107_cause", after["ne107_cause"])
        why = f", {cause}" if after["ne107_cause"] else ""
        said.append(f"NE 107: {code_text('ne107', after['ne107'])}{why}")
    return said + [text for name, text in COUNTED.items() if name in both and before[name] != after[name]]

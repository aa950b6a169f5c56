"""What a history keeps: each class is a table of that name, each field a column. SI units; times in s since 1970, UTC.

A number that is not known (NaN) is NULL. Of entries with the same `KEY` the later takes the place of the earlier.
"""

from dataclasses import dataclass
from typing import ClassVar

from config.codes import EventKind

Key = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a valve: the `number`-th of its events."""

    TABLE: ClassVar = "events"
    KEY: ClassVar[Key] = ("valve", "number")

    valve: str
    number: int
    time_s: float
    kind: int
    """Of `config.codes.EventKind`."""
    name: str
    """Of that kind."""
    ne107: int
    """Its class by NAMUR NE 107, as `config.codes.Ne107Status`."""
    cause: int
    """Of the code that goes with the kind, `config.codes.CAUSES`; 0 where there is none."""
    text: str
    """The cause in words."""

    @property
    def words(self) -> str:
        """What happened, and its cause; of a kind that this version does not know, its name."""
        kind = EventKind(self.kind).text if self.kind in list(EventKind) else self.name or f"event {self.kind}"
        return kind + (f": {self.text}" if self.text else "")


@dataclass(frozen=True, slots=True)
class Write:
    """A write or a session of a client; like ones of one peer without another between them are one, with how many."""

    TABLE: ClassVar = "writes"
    KEY: ClassVar[Key] = ("number",)

    number: int
    valve: str
    """Empty where a session may be about any."""
    begin_s: float
    end_s: float
    """Of the first and of the last of them."""
    times: int
    what: str
    """`write`, `refused`, `connected`, `turned away`, `gone`."""
    peer: str
    """`host:port`."""
    who: str
    """The name in its certificate; empty in the clear."""
    role: str
    """`observer`, `operator`, `engineer`, `none`; empty in the clear."""
    text: str
    """Registers and values, or why not."""


@dataclass(frozen=True, slots=True)
class Identification:
    """An identification that was applied or refused: estimates with their standard deviations."""

    TABLE: ClassVar = "identifications"
    KEY: ClassVar[Key] = ()

    valve: str
    time_s: float
    applied: int
    """1 or 0."""
    reason: str
    a: float
    a_std: float
    b: float
    b_std: float
    c: float
    c_std: float
    k: float
    k_std: float
    b_over_c: float
    b_over_c_std: float
    k_over_c: float
    k_over_c_std: float
    breakaway: float
    breakaway_std: float
    b_over_c_applied: float
    """In use after it, as the next two."""
    k_over_c_applied: float
    offset_applied: float


@dataclass(frozen=True, slots=True)
class HealthHour:
    """A valve's health at the end of an hour, or as far as it has come; counts are since new, or since the start."""

    TABLE: ClassVar = "health"
    KEY: ClassVar[Key] = ("valve", "hour_s")

    valve: str
    hour_s: int
    """When the hour began."""
    ne107_worst: int
    """The worst class in it, looked at once a minute."""
    travel_m: float
    reversals: int
    stiction_index: float
    moves_judged: int
    friction_pa: float
    friction_baseline_pa: float
    cycles: int
    missed_periods: int
    lost_samples: int
    lost_replies: int
    unrecorded: int


@dataclass(frozen=True, slots=True)
class Setting:
    """A key of the daemon's file as it was at the last start."""

    TABLE: ClassVar = "configuration"
    KEY: ClassVar[Key] = ("valve", "key")

    valve: str
    key: str
    value: str
    """As JSON; empty where the key is no longer given."""


@dataclass(frozen=True, slots=True)
class ConfigurationChange:
    """A key that was another at the start before."""

    TABLE: ClassVar = "configuration_changes"
    KEY: ClassVar[Key] = ()

    valve: str
    time_s: float
    key: str
    was: str
    now: str


Entry = Event | Write | Identification | HealthHour | Setting | ConfigurationChange
TABLES: tuple[type[Entry], ...] = (Event, Write, Identification, HealthHour, Setting, ConfigurationChange)

"""What is kept of a valve's health over a restart: one small JSON file, replaced whole.

A crash leaves the old one or the new one (`config.whole_file`). One
that cannot be read is never mended: it is put aside as `FILE.unreadable`, the log says why, and the counts start anew.
The baseline is a pressure: beside it stands by which scales the device's pressures were read, and where one of them is
another now, it is none.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from config.errors import InputError
from config.loading import Fraction, Many, NonNegative, Schema, between, validate
from config.whole_file import replace_whole, unreadable
from positioner.daemon.health.daily_figures import OperationDay
from positioner.daemon.health.valve_conditions import CauseName, KeptConditions

VERSION: Literal[1] = 1
Scales = Mapping[str, str]
"""Of the device's pressures: keys of the configuration and their values."""


@dataclass(frozen=True, slots=True)
class HealthRecord:
    """Counts since new or since they were reset, and the friction that is called normal (None: none yet)."""

    travel_m: float = 0.0
    reversals: int = 0
    stiction_index: float = 0.0
    moves_judged: int = 0
    baseline_pa: float | None = None


class KeptAlarm(Schema):
    """An alarm as it was left."""

    holds: bool
    acknowledged: bool
    since_s: NonNegative
    shelved_until_s: NonNegative


class KeptMore(Schema):
    """What else is kept."""

    conditions: KeptConditions = KeptConditions()
    days: Many[OperationDay] = ()
    alarms: dict[CauseName, KeptAlarm] = Field(default_factory=dict)


NOTHING_MORE = KeptMore()


class _KeptFile(Schema):
    """The file. No valve comes so far as its counts may, and a register can hold each."""

    version: Literal[1]
    valve: str
    travel_m: Annotated[float, between(0.0, 1e9)]
    reversals: Annotated[int, between(0, 2**32 - 1)]
    stiction_index: Fraction
    moves_judged: Annotated[int, between(0, 2**32 - 1)]
    baseline_pa: Annotated[float, between(1e-3, 1e12)] | None
    """In the drive's own unit."""
    scales: dict[str, str] = Field(default_factory=dict)
    """Kept since the second form of the file, and"""
    more: KeptMore = NOTHING_MORE
    """since the third."""


@dataclass(frozen=True, slots=True)
class KeptHealth:
    """What was kept of a valve; a fresh record where nothing was.

    Attributes:
        record: of today's scales.
        problem: why what was there cannot be read.
        rescaled: which scale is another than that of the baseline, which was dropped, and what it was.
        more: what is kept beside the counts.
    """

    record: HealthRecord = HealthRecord()
    problem: str | None = None
    rescaled: str | None = None
    more: KeptMore = NOTHING_MORE


def read_record(path: Path, valve: str, scales: Scales) -> KeptHealth:
    """Return what was kept of a valve whose pressures are read by these scales.

    Raises:
        OSError: the file is there and cannot be opened, or not be put aside.
    """
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        return KeptHealth()
    try:
        kept = _parsed(path, text, valve)
    except InputError as error:
        aside = path.replace(unreadable(path))
        return KeptHealth(problem=f"{error.problem}; it is {aside.name} now")
    record = HealthRecord(**{each.name: getattr(kept, each.name) for each in fields(HealthRecord)})
    before = kept.scales
    others = [f"{key} was {before[key]}, is {now}" for key, now in scales.items() if before.get(key, now) != now]
    if record.baseline_pa is None or not others:
        return KeptHealth(record, more=kept.more)
    dropped = f"{others[0]}; it was {record.baseline_pa:.7g} Pa"
    return KeptHealth(replace(record, baseline_pa=None), rescaled=dropped, more=kept.more)


def kept_days(path: Path, valve: str) -> tuple[OperationDay, ...]:
    """Return the days that are kept of a valve, oldest first; none where no file is there. Changes nothing.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        return _parsed(path, path.read_bytes(), valve).more.days
    except FileNotFoundError:
        return ()
    except OSError as error:
        raise InputError(str(path), f"the health record cannot be read: {error}") from None


def write_record(path: Path, valve: str, record: HealthRecord, scales: Scales, more: KeptMore = NOTHING_MORE) -> None:
    """Replace the file whole.

    Raises:
        OSError: it cannot be written.
    """
    content = {"version": VERSION, "valve": valve, **asdict(record), "scales": dict(scales)}
    replace_whole(path, json.dumps({**content, "more": more.model_dump(mode="json")}, allow_nan=False) + "\n")


def _parsed(path: Path, text: bytes, valve: str) -> _KeptFile:
    """Return what a file holds.

    Raises:
        InputError: it is not of this form, or another valve's.
    """
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(str(path), f"is not JSON: {str(error).partition(';')[0]}") from None
    kept = validate(_KeptFile, content, str(path))
    if kept.valve != valve:
        raise InputError(str(path), f"valve: allowed is {valve!r}, got {kept.valve!r}")
    return kept

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

from pydantic import Field, ValidationError

from config.errors import InputError
from config.loading import Many, NonNegative, Schema
from config.whole_file import replace_whole
from positioner.daemon.health.daily_figures import OperationDay
from positioner.daemon.health.valve_conditions import CauseName, KeptConditions

VERSION = 1
WHOLE = frozenset({"reversals", "moves_judged"})
ALLOWED: Mapping[str, tuple[float, float]] = {
    "travel_m": (0.0, 1e9),
    "reversals": (0, 2**32 - 1),
    "stiction_index": (0.0, 1.0),
    "moves_judged": (0, 2**32 - 1),
    "baseline_pa": (1e-3, 1e12),
}
"""Of each count, and of the friction in the drive's own unit: no valve comes so far, and a register can hold it."""
SCALES = "scales"
MORE = "more"
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


class _Unreadable(Exception):
    pass


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
        record, before, more = _parsed(text, valve)
    except _Unreadable as error:
        path.replace(path.with_name(path.name + ".unreadable"))
        return KeptHealth(problem=str(error))
    others = [f"{key} was {before[key]}, is {now}" for key, now in scales.items() if before.get(key, now) != now]
    if record.baseline_pa is None or not others:
        return KeptHealth(record, more=more)
    dropped = f"{others[0]}; it was {record.baseline_pa:.7g} Pa"
    return KeptHealth(replace(record, baseline_pa=None), rescaled=dropped, more=more)


def kept_days(path: Path, valve: str) -> tuple[OperationDay, ...]:
    """Return the days that are kept of a valve, oldest first; none where no file is there. Changes nothing.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        return _parsed(path.read_bytes(), valve)[2].days
    except FileNotFoundError:
        return ()
    except (OSError, _Unreadable) as error:
        raise InputError(str(path), f"the health record cannot be read: {error}") from None


def write_record(path: Path, valve: str, record: HealthRecord, scales: Scales, more: KeptMore = NOTHING_MORE) -> None:
    """Replace the file whole.

    Raises:
        OSError: it cannot be written.
    """
    content = {"version": VERSION, "valve": valve, **asdict(record), SCALES: dict(scales)}
    content[MORE] = more.model_dump(mode="json")
    replace_whole(path, json.dumps(content, allow_nan=False) + "\n")


def _parsed(text: bytes, valve: str) -> tuple[HealthRecord, Scales, KeptMore]:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _Unreadable(f"is not JSON: {str(error).partition(';')[0]}") from None
    names = {field.name for field in fields(HealthRecord)}
    if not isinstance(content, dict) or content.keys() - {SCALES, MORE} != names | {"version", "valve"}:
        raise _Unreadable(f"must hold version, valve, {', '.join(sorted(names))}, {SCALES}, {MORE} and nothing else")
    for key, allowed in (("version", VERSION), ("valve", valve)):
        if content[key] != allowed:
            raise _Unreadable(f"{key}: allowed is {allowed!r}, got {content[key]!r}")
    for name in names:
        if problem := _problem(name, content[name]):
            raise _Unreadable(f"{name}: {problem}, got {content[name]!r:.40}")
    scales = content.get(SCALES, {})  # kept since the second form of the file only
    if not isinstance(scales, dict) or not all(isinstance(each, str) for each in scales.values()):
        raise _Unreadable(f"{SCALES}: must be a table of texts, got {scales!r}")
    try:
        more = KeptMore.model_validate(content.get(MORE, {}))  # kept since the third form of the file only
    except ValidationError as error:
        first = error.errors()[0]
        raise _Unreadable(f"{MORE}.{'.'.join(map(str, first['loc']))}: {first['msg']}") from None
    return HealthRecord(**{name: content[name] for name in names}), scales, more


def _problem(name: str, value: object) -> str | None:
    least, most = ALLOWED[name]
    if value is None and name == "baseline_pa":
        return None
    kinds = int if name in WHOLE else int | float
    if isinstance(value, kinds) and not isinstance(value, bool) and least <= value <= most:
        return None
    return f"must be {'a whole' if name in WHOLE else 'a'} number from {least:g} to {most:g}" + (
        ", or null" if name == "baseline_pa" else ""
    )

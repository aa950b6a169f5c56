"""What is kept of a valve's health over a restart: one small JSON file, replaced whole.

A crash leaves the old one or the new one (`config.whole_file`). One
that cannot be read is never mended: it is put aside as `FILE.unreadable`, the log says why, and the counts start anew.
"""

import json
import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path

from config.whole_file import replace_whole

VERSION = 1


@dataclass(frozen=True, slots=True)
class HealthRecord:
    """Counts since new or since they were reset, and the friction that is called normal (None: none yet)."""

    travel_m: float = 0.0
    reversals: int = 0
    stiction_index: float = 0.0
    moves_judged: int = 0
    baseline_pa: float | None = None


class _Unreadable(Exception):
    pass


def read_record(path: Path, valve: str) -> tuple[HealthRecord, str | None]:
    """Return what was kept of a valve, a fresh record when nothing was; and why what was there cannot be read.

    Raises:
        OSError: the file is there and cannot be opened, or not be put aside.
    """
    try:
        text = path.read_bytes()
    except FileNotFoundError:
        return HealthRecord(), None
    try:
        return _parsed(text, valve), None
    except _Unreadable as error:
        path.replace(path.with_name(path.name + ".unreadable"))
        return HealthRecord(), str(error)


def write_record(path: Path, valve: str, record: HealthRecord) -> None:
    """Replace the file whole.

    Raises:
        OSError: it cannot be written.
    """
    content = {"version": VERSION, "valve": valve, **asdict(record)}
    replace_whole(path, json.dumps(content, allow_nan=False) + "\n")


def _parsed(text: bytes, valve: str) -> HealthRecord:
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _Unreadable(f"is not JSON: {str(error).partition(';')[0]}") from None
    names = {field.name for field in fields(HealthRecord)}
    if not isinstance(content, dict) or content.keys() != names | {"version", "valve"}:
        raise _Unreadable(f"must hold version, valve, {', '.join(sorted(names))} and nothing else")
    for key, allowed in (("version", VERSION), ("valve", valve)):
        if content[key] != allowed:
            raise _Unreadable(f"{key}: allowed is {allowed!r}, got {content[key]!r}")
    for name in names:
        if problem := _problem(name, content[name]):
            raise _Unreadable(f"{name}: {problem}, got {content[name]!r}")
    return HealthRecord(**{name: content[name] for name in names})


def _problem(name: str, value: object) -> str | None:
    if name in ("reversals", "moves_judged"):
        whole = isinstance(value, int) and not isinstance(value, bool) and value >= 0
        return None if whole else "must be a whole number from 0 up"
    if name == "baseline_pa":
        return None if value is None or _from(value, 0.0, above=True) else "must be a number above 0, or null"
    within = _from(value, 0.0) and (name != "stiction_index" or float(value) <= 1.0)  # type: ignore[arg-type]
    return None if within else "must be a number from 0 up" + (" to 1" if name == "stiction_index" else "")


def _from(value: object, least: float, *, above: bool = False) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    try:
        number = float(value)
    except OverflowError:  # a whole number of more digits than any
        return False
    return math.isfinite(number) and (number > least if above else number >= least)

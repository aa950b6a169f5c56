"""The file that keeps what is known of one valve: JSON, with a version and a checksum, replaced whole.

    {"version": 3, "sha256": of `content` as compact JSON with sorted keys,
     "content": {"valve", "written": date, "conditions": key to value, "digest": of the conditions, "knowledge"}}

A crash leaves the old file or the new one (`config.whole_file`). What is torn, tampered with, another valve's or of a
newer version, and what was learnt under another configuration, is never used, not even in part, and never overwritten:
it is set aside under another name, and the log says why in one line.
"""

import hashlib
import json
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from config.whole_file import replace_whole
from positioner.control.valve_knowledge import ValveKnowledge
from positioner.daemon.memory.knowledge_record import knowledge_in, record_of
from positioner.daemon.memory.known_configuration import Conditions, changed

VERSION = 3
SET_ASIDE = ".set_aside"
KEYS = frozenset({"valve", "written", "conditions", "digest", "knowledge"})


class _Unusable(Exception):
    pass


@dataclass(frozen=True, slots=True)
class Kept:
    """What a file held: knowledge and when it was written, or why it was set aside; neither when there was none."""

    knowledge: ValveKnowledge | None = None
    written: str | None = None
    problem: str | None = None


def read_memory(path: Path, valve: str, conditions: Conditions) -> Kept:
    """Return what was kept of a valve, if it holds under the conditions of now; what does not is set aside.

    Raises:
        OSError: the file is there and cannot be read, or not be set aside.
    """
    kept = look_at(path, valve, conditions)
    if kept.problem is not None:
        set_aside(path)
    return kept


def look_at(path: Path, valve: str, conditions: Conditions) -> Kept:
    """Return what is kept of a valve and leave it where it is, whatever it is worth.

    Raises:
        OSError: the file is there and cannot be read.
    """
    try:
        return _parsed(path.read_bytes(), valve, conditions)
    except FileNotFoundError:
        return Kept()
    except _Unusable as error:
        return Kept(problem=str(error))


def write_memory(path: Path, valve: str, conditions: Conditions, knowledge: ValveKnowledge) -> None:
    """Replace the file whole.

    Raises:
        OSError: it cannot be written; the old one is as it was.
    """
    content = {
        "valve": valve,
        "written": datetime.now(UTC).isoformat(timespec="seconds"),
        "conditions": dict(conditions),
        "digest": _digest(dict(conditions)),
        "knowledge": record_of(knowledge),
    }
    file = {"version": VERSION, "sha256": _digest(content), "content": content}
    replace_whole(path, json.dumps(file, allow_nan=False, indent=1) + "\n")


def set_aside(path: Path) -> None:
    """Give a file a name under which nobody reads it; an earlier one of that name is lost.

    Raises:
        OSError: it cannot be done.
    """
    path.replace(path.with_name(path.name + SET_ASIDE))


def _parsed(text: bytes, valve: str, conditions: Conditions) -> Kept:
    try:
        file = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise _Unusable(f"is not JSON: {error}") from None
    version = file.get("version") if isinstance(file, dict) else None
    if not isinstance(version, int) or isinstance(version, bool):
        raise _Unusable("has no version")
    if version != VERSION:
        raise _Unusable(f"version: allowed is {VERSION}, got {version}")
    content = file.get("content")
    if file.keys() != {"version", "sha256", "content"} or not isinstance(content, dict) or content.keys() != KEYS:
        raise _Unusable(f"must hold version, sha256 and a content of {', '.join(sorted(KEYS))}")
    if file["sha256"] != _digest(content):
        raise _Unusable("sha256: is not that of the content: it was torn, or changed by hand")
    if content["valve"] != valve:
        raise _Unusable(f"valve: allowed is {valve!r}, got {content['valve']!r}")
    kept, written = content["conditions"], str(content["written"])
    if not isinstance(kept, dict) or content["digest"] != _digest(kept):
        raise _Unusable("digest: is not that of the conditions")
    if difference := changed(kept, conditions):
        raise _Unusable(f"was learnt under another configuration: {difference}")
    try:
        return Kept(knowledge_in(content["knowledge"]), written)
    except ValueError as error:
        raise _Unusable(f"knowledge.{error}") from None


def _digest(content: dict[str, Any]) -> str:
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()

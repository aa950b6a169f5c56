"""The files of a slave and a daemon, from tables that say what differs from what the fixtures begin with.

Tables are given in the words of the files (`config/profiles/`): what is a table there is a mapping, what is [[a list]]
a sequence of mappings. The standard library alone: nothing is checked here but what is read here; slave and daemon
check the rest, and name key, value and what is allowed.
"""

import json
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from positioner.testing.child_process import HOME, NotStarted

Tables = Mapping[str, Any]
LOCKSTEP: Tables = {"clock": {"mode": "lockstep"}}
STALE_S = 10.0
"""In lockstep nothing is late that a busy machine takes long for."""
LATE_S = 5.0


def slave_text(given: Tables, folder: Path, seen_from: Path) -> str:
    """Return the slave's file; lockstep unless told otherwise.

    Args:
        given: its tables; `effect` are tables added to those of the valve file.
        folder: where the slave's file will be; a valve file with the effects added is written there.
        seen_from: where a path of a valve file counts from.

    Raises:
        NotStarted: a valve file that cannot be read.
    """
    tables = merge_tables(LOCKSTEP, given)
    effects = tables.pop("effect", ())
    valve = valve_path(str(tables.get("valve", "seed")), seen_from)
    if effects:
        text = valve.read_text(encoding="utf-8") + "\n" + toml_text({"effect": effects})
        valve = folder / "valve.toml"
        valve.write_text(text, encoding="utf-8")
    return toml_text({**tables, "valve": str(valve)})


def daemon_text(given: Tables, stroke_m: float, port: int, lockstep: bool) -> str:
    """Return the daemon's file for a device on a port of this machine; its pace is that of the device in lockstep."""
    tables: Tables = {
        "valve": {"stroke_m": stroke_m},
        "device": {"port": port},
        "supervisory": {"port": 0},
        "recorder": {"folder": "recordings"},
    }
    if lockstep:
        at_leisure = {"device": {"reply_timeout_s": LATE_S}, "safety": {"stale_after_s": STALE_S}}
        tables = merge_tables(merge_tables(tables, at_leisure), {"cycle": {"pace": "device"}})
    return toml_text(merge_tables(tables, given))


def valve_path(text: str, seen_from: Path) -> Path:
    """Return the file of a valve: a path, or a valve that comes along by its name.

    Raises:
        NotStarted: there is none.
    """
    path = seen_from / text if text.endswith(".toml") else HOME / "config" / "valves" / f"{text}.toml"
    if not path.is_file():
        there = ", ".join(sorted(each.stem for each in (HOME / "config" / "valves").glob("*.toml")))
        raise NotStarted(f"valve: no file {path}; by name there are: {there}")
    return path.resolve()


def stroke_in(valve: Path) -> float:
    """Return the stroke of a valve file, m.

    Raises:
        NotStarted: it has none.
    """
    try:
        return float(tomllib.loads(valve.read_text(encoding="utf-8"))["valve"]["stroke_m"])
    except (tomllib.TOMLDecodeError, KeyError, TypeError, ValueError):
        raise NotStarted(f"{valve}: valve.stroke_m: cannot be read") from None


def merge_tables(below: Tables, above: Tables) -> dict[str, Any]:
    """Return tables with others laid over them, key by key."""
    return {
        **below,
        **{
            key: merge_tables(below[key], value)
            if isinstance(value, Mapping) and isinstance(below.get(key), Mapping)
            else value
            for key, value in above.items()
        },
    }


def toml_text(tables: Tables) -> str:
    """Return tables as TOML; tables within tables stand in braces."""
    plain = {key: value for key, value in tables.items() if not _is_table(value) and not _is_list_of_tables(value)}
    lines = [f"{key} = {_value(value)}" for key, value in plain.items()]
    for key, value in tables.items():
        for each in [value] if _is_table(value) else value if _is_list_of_tables(value) else []:
            lines.append(f"[{key}]" if _is_table(value) else f"[[{key}]]")
            lines += [f"{name} = {_value(inner)}" for name, inner in each.items()]
    return "\n".join([*lines, ""])


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping)


def _is_list_of_tables(value: object) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str) and any(map(_is_table, value))


def _value(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, bool | str):
        return json.dumps(value, ensure_ascii=False)
    return str(value) if isinstance(value, Path) else repr(value)

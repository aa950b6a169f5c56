"""Keys of a TOML file given new values, while its comments, its order and all else stay as they are.

A key that stands in its table keeps its line and its comment; one that does not stands below the table's head; a table
that does not, at the end. What comes of it is read again: it must say what was asked for, and else what it said before.
"""

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any

from config.errors import InputError

Value = float | str | bool
HEAD = re.compile(r"^\s*\[\s*([A-Za-z0-9_.-]+)\s*\]\s*(#.*)?$")
ANY_HEAD = re.compile(r"^\s*\[")


def with_values(text: str, values: Mapping[tuple[str, str], Value], source: str = "file") -> str:
    """Return the text with values by table and key.

    Raises:
        InputError: the text says something so that a key cannot be given a value by a line of its own.

    >>> print(with_values("[valve]  # ours\\nstroke_m = 0.1  # m\\n", {("valve", "stroke_m"): 0.04}), end="")
    [valve]  # ours
    stroke_m = 0.04  # m
    """
    wanted = tomllib.loads(text)
    for (table, key), value in values.items():
        wanted.setdefault(table, {})
        if not isinstance(wanted[table], dict):
            raise InputError(source, f"{table}: several of them; write {key} = {_format_value(value)} by hand")
        wanted[table][key] = value
    lines = text.splitlines()
    for (table, key), value in values.items():
        lines = _with(lines, table, key, value)
    new = "\n".join(lines) + "\n"
    if _read(new) != wanted:
        asked = ", ".join(f"{table}.{key} = {_format_value(value)}" for (table, key), value in values.items())
        raise InputError(source, f"cannot be changed without touching what else it says; write by hand: {asked}")
    return new


def _with(lines: list[str], table: str, key: str, value: Value) -> list[str]:
    heads = [number for number, line in enumerate(lines) if (match := HEAD.match(line)) and match[1] == table]
    if not heads:
        gap = [""] if lines and lines[-1].strip() else []
        return [*lines, *gap, f"[{table}]", f"{key} = {_format_value(value)}"]
    first = heads[0] + 1
    last = next((number for number in range(first, len(lines)) if ANY_HEAD.match(lines[number])), len(lines))
    for number in range(first, last):
        if match := re.match(
            rf"^(\s*{re.escape(key)}\s*=\s*)([^#\"']*?|\"[^\"]*\"|'[^']*')(\s*(?:#.*)?)$", lines[number]
        ):
            return [*lines[:number], f"{match[1]}{_format_value(value)}{match[3]}", *lines[number + 1 :]]
    return [*lines[:first], f"{key} = {_format_value(value)}", *lines[first:]]


def _format_value(value: Value) -> str:
    # A JSON string, number or truth is a TOML one.
    return json.dumps(value)


def _read(text: str) -> dict[str, Any] | None:
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return None

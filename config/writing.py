"""Writes a valve file, the inverse of `config.valve.load_valve`."""

import json
from collections.abc import Mapping
from typing import Any

from config.valve import ValveFile


def valve_toml(file: ValveFile) -> str:
    """Return the text of a valve file; numbers keep every bit."""
    tables = [("[valve]", file.valve.model_dump())]
    tables += [("[[effect]]", {"name": each.name, **each.parameters}) for each in file.effect]
    return "\n".join(f"{head}\n{_lines(table)}" for head, table in tables)


def _lines(table: Mapping[str, Any]) -> str:
    # A JSON string or number is a TOML one.
    return "".join(f"{key} = {json.dumps(value)}\n" for key, value in table.items())

"""What is another in the daemon's file than at the last start, key by key."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from config.daemon_file import DaemonFile
from positioner.history.entries import ConfigurationChange, Setting

NAMED = 3
"""Keys that the event names; the table has all."""


def settings_of(file: DaemonFile) -> dict[str, str]:
    """Return all keys that are given or have a default, dotted, with their values as JSON."""
    return dict(_flat(file.model_dump(mode="json")))


def changes(
    valve: str, before: Mapping[str, str], now: Mapping[str, str], time_s: float
) -> list[ConfigurationChange | Setting]:
    """Return the rows that a start with this configuration makes; of the first start, no changes."""
    rows: list[ConfigurationChange | Setting] = []
    for key in sorted(before.keys() | now.keys()):
        was, has = before.get(key, ""), now.get(key, "")
        if was != has:
            rows.append(Setting(valve, key, has))
            if before:
                rows.append(ConfigurationChange(valve, time_s, key, was, has))
    return rows


def in_words(rows: list[ConfigurationChange | Setting]) -> str:
    """Return the first changes in one line; empty where there are none."""
    changed = [row for row in rows if isinstance(row, ConfigurationChange)]
    said = [f"{row.key} was {row.was or 'not given'}, is {row.now or 'not given'}" for row in changed[:NAMED]]
    more = len(changed) - len(said)
    return "; ".join(said) + (f"; and {more} more" if more else "")


def _flat(tables: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    for key, value in tables.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{before}{key}.")
        elif value is not None:
            yield f"{before}{key}", json.dumps(value)

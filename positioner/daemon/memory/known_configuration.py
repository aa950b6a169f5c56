"""For which configuration something is known: the keys of the daemon's file that it hangs on, and their values.

A device that stands elsewhere or scales its registers otherwise is another device; who changes stroke, period, pressure
limits, table `[law]` or the extended valve that it names knows better than what was learnt. How long a reply may take
says nothing of the valve.
"""

import json
from collections.abc import Mapping
from dataclasses import astuple
from hashlib import sha256
from typing import Any

from config.daemon_file import DaemonFile
from config.extended_valve import ExtendedValve

TABLES = ("device", "valve", "pressure", "law")
OF_THE_LINK = frozenset(
    {"device.reply_timeout_s", "device.communication_timeout_s", "device.communication_action", "device.tls"}
)
"""These say how the device is talked to, not what it is."""

AS_EVER = frozenset({("valve.action", '"air_to_open"'), ("valve.actuator", '"spring_return"')})
"""What every valve was before there was a word for it: a file of then says the same."""

EXTENDED = "the file of law.valve, its digest"

PRESSURES = frozenset({"command_pa", "pressure_pa"})
SCALING = frozenset({"scale", "offset"})

Conditions = Mapping[str, str]
"""Values by key, both as in the file: what is JSON is TOML."""


def conditions_of(file: DaemonFile, extended: ExtendedValve | None = None) -> Conditions:
    """Return the keys that what is known of a valve hangs on, with their values; of an extended valve a digest."""
    tables = file.model_dump(mode="json")
    flat = _flat({key: tables[key] for key in TABLES} | {"cycle": {"period_s": file.cycle.period_s}})
    for key in AS_EVER & flat.items():
        del flat[key[0]]
    if extended is not None:
        flat[EXTENDED] = sha256(repr(astuple(extended)).encode()).hexdigest()
    return {key: value for key, value in sorted(flat.items()) if not _of_the_link(key)}


def pressure_scales(file: DaemonFile) -> Conditions:
    """Return the keys that say what pressure a number of the device is, with their values."""
    return {key: value for key, value in conditions_of(file).items() if _scales_a_pressure(key.split("."))}


def _scales_a_pressure(parts: list[str]) -> bool:
    return not PRESSURES.isdisjoint(parts) and parts[-1] in SCALING


def changed(kept: Conditions, now: Conditions) -> str | None:
    """Say which key has changed, from what to what; None if none has."""
    for key in sorted(kept.keys() | now.keys()):
        was, has = kept.get(key, "nothing"), now.get(key, "nothing")
        if was != has:
            return f"{key} was {was}, is {has}"
    return None


def _of_the_link(key: str) -> bool:
    return any(key == each or key.startswith(f"{each}.") for each in OF_THE_LINK)


def _flat(tables: Mapping[str, Any], before: str = "") -> dict[str, str]:
    """Return what stands in tables by dotted keys; what is not given has no key."""
    found: dict[str, str] = {}
    for key, value in tables.items():
        if isinstance(value, dict):
            found |= _flat(value, f"{before}{key}.")
        elif value is not None:
            found[f"{before}{key}"] = json.dumps(value)
    return found

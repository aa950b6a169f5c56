"""Which of the three files a person writes it is, by its tables: to say so where another one is asked for.

valve     a table [valve] with a mass, or a table [drive]
daemon    a table [device]
slave     a table [bus], [sensor], [clock] or [initial], or valve = "NAME"
"""

from collections.abc import Mapping
from typing import Any, Literal

from config.errors import InputError

FileKind = Literal["valve", "slave", "daemon"]
OF_SLAVE = frozenset({"bus", "sensor", "clock", "initial"})
"""Tables that only a slave's file has."""
VALVE_SAID = "a valve file, or a shipped valve: ordinary, rotary, seed (the paper's)"
"""What a command line says of a valve that it takes."""


def require_kind(tables: Mapping[str, Any], wanted: FileKind, source: str) -> None:
    """Refuse tables that are surely those of another file.

    Raises:
        InputError: says which file it is, and which is asked for.
    """
    found = _kind(tables)
    if found and found != wanted:
        raise InputError(source, f"is the file of a {found}; here that of a {wanted} is asked for")


def _kind(tables: Mapping[str, Any]) -> FileKind | None:
    """Return which file it is; None where its tables do not tell."""
    valve = tables.get("valve")
    if "drive" in tables or (isinstance(valve, dict) and "mass_kg" in valve):
        return "valve"
    if "device" in tables:
        return "daemon"
    return "slave" if isinstance(valve, str) or OF_SLAVE & tables.keys() else None

"""What the installed packages offer by entry points: buses, drivers, commands; each name once."""

from importlib.metadata import EntryPoint, entry_points

from config.errors import InputError


def find_offers(group: str, kind: str) -> dict[str, EntryPoint]:
    """Return what is offered in a group, by name; `kind` says what that is: "bus".

    Raises:
        InputError: two packages offer the same name.
    """
    by_name: dict[str, EntryPoint] = {}
    for entry in entry_points(group=group):
        other = by_name.setdefault(entry.name, entry)
        if other.value != entry.value:
            raise InputError(origin(entry), f"{kind} {entry.name!r} is offered by {origin(other)} too; remove one")
    return by_name


def origin(entry: EntryPoint) -> str:
    """Return whose an entry point is."""
    return f"package {entry.dist.name}" if entry.dist else "a package without a name"

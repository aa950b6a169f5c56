"""What the workbench calls "recording" or "valve file" gets the name that the person gave it."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

from config.errors import InputError


@contextmanager
def naming(names: Mapping[str, str]) -> Iterator[None]:
    """Give errors that name a kind of file, or a place in it, the name of the file."""
    try:
        yield
    except InputError as error:
        raise error.named(names) from None


def files_named(fitted: Sequence[Path], held_out: Path | None, valve: str) -> dict[str, str]:
    """Return the names of what is fitted, of what is held out, the end of the same where it is no other, and the valve.

    >>> files_named([Path("a.csv"), Path("b.csv")], None, "seed")["held-out recording"]
    'the held-out end of a.csv, b.csv'
    """
    recordings = ", ".join(map(str, fitted))
    apart = f"the held-out end of {recordings}" if held_out is None else str(held_out)
    return {"recording": recordings, "held-out recording": apart, "valve file": valve}

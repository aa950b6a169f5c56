"""What the workbench calls "recording" or "valve file" gets the name that the person gave it."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from config.errors import InputError


@contextmanager
def naming(names: Mapping[str, str]) -> Iterator[None]:
    """Give errors that name a kind of file, or a place in it, the name of the file."""
    try:
        yield
    except InputError as error:
        raise error.named(names) from None

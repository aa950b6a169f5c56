"""Searches broken off: by Ctrl-C, or because their time is over.

Whoever starts searches says by `ending` when they are to end. Each asks before every simulation (`go_on`), whichever
thread it is on, so that all have ended some milliseconds later.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Over = Callable[[], bool]


class BrokenOff(Exception):
    """A search was asked to end before it was through."""


def _never() -> bool:
    return False


_OVER: ContextVar[Over] = ContextVar("over", default=_never)


@contextmanager
def ending(over: Over) -> Iterator[None]:
    """Break off the searches begun inside, on this thread and on theirs, as soon as it is over."""
    before = _OVER.set(over)
    try:
        yield
    finally:
        _OVER.reset(before)


def over() -> Over:
    """Return what says on this thread whether searches are to end."""
    return _OVER.get()


def go_on() -> None:
    """Do nothing, unless searches are to end.

    Raises:
        BrokenOff: they are.
    """
    if _OVER.get()():
        raise BrokenOff

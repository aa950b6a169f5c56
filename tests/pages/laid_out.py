"""What is laid on a desk, and what a work's process does: nothing of the page comes with it into that process."""

from functools import cache
from threading import Event

from workbench.blind.hiding import Hidden, hide
from workbench.page.background import Progressed, Tell


@cache
def hidden() -> Hidden:
    """A valve and two short recordings, made once."""
    return hide(7, duration_s=5.0)


def never_ends(tell: Tell, *_: object) -> None:
    tell(Progressed("begun", 0.0))
    Event().wait()


def ends(*_: object) -> str:
    return "found"

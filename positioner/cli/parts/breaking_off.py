"""Ctrl-C during long work: how far it came is said. No file of results is written by then, only what was measured.

What else ends a command may be taken, too, by whom something would outlive: a valve that is played on, a process.
"""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from types import FrameType

ENDS = tuple(getattr(signal, each) for each in ("SIGTERM", "SIGHUP") if hasattr(signal, each))
"""What ends a command at once: `kill`, a supervisor's time limit, a terminal that is closed (not on Windows)."""
Handler = Callable[[int, FrameType | None], None]


@contextmanager
def tell_when_broken_off(command: str, known: Callable[[], str]) -> Iterator[None]:
    """Say on standard error what is known when the work is broken off.

    Args:
        command: of the person, as messages name it.
        known: what is known so far, in a few words.

    Raises:
        KeyboardInterrupt: it was; searches on threads have ended by then (`workbench.fit.breaking_off`).
    """
    try:
        yield
    except KeyboardInterrupt:
        end = "\n" if sys.stderr.isatty() else ""
        print(f"{end}positioner {command}: broken off; {known()}", file=sys.stderr, flush=True)
        raise


@contextmanager
def end_by(handler: Handler) -> Iterator[None]:
    """Have a handler take what ends a command at once, so that what it began ends first. What is ignored stays so."""
    before = {each: known for each in ENDS if (known := signal.getsignal(each)) is not signal.SIG_IGN}
    for each in before:
        signal.signal(each, handler)
    try:
        yield
    finally:
        for each, known in before.items():
            signal.signal(each, known)


def end_as_by_ctrl_c() -> AbstractContextManager[None]:
    """Take what ends a command for Ctrl-C: who moves a valve lets go of it then. Under nohup it goes on."""
    return end_by(signal.default_int_handler)

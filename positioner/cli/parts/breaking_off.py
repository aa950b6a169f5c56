"""Ctrl-C during long work: how far it came is said. No file of results is written by then, only what was measured."""

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def told_when_broken_off(command: str, known: Callable[[], str]) -> Iterator[None]:
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
def ended_as_by_ctrl_c() -> Iterator[None]:
    """Take what ends a command, a terminal that is gone among it, for Ctrl-C: who moves a valve lets go of it then.

    What is ignored stays ignored, as under nohup.
    """
    ending = [each for each in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(each) is signal.SIG_DFL]
    for each in ending:
        signal.signal(each, signal.default_int_handler)
    try:
        yield
    finally:
        for each in ending:
            signal.signal(each, signal.SIG_DFL)

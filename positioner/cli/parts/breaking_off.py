"""Ctrl-C during long work: what is known so far is said, and the command ends at once.

The searches are on threads in compiled code, which no exception reaches: to wait for them would take as long as they
do. So the process ends without them. Nothing has been written by then: files come after the work.
"""

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import current_thread, main_thread
from types import FrameType

INTERRUPTED = 130
"""Exit status, as shells have it."""


@contextmanager
def told_when_broken_off(command: str, known: Callable[[], str]) -> Iterator[None]:
    """While the work is done, let Ctrl-C say what is known and end the process.

    Args:
        command: of the person, as messages name it.
        known: what is known so far, one line or more.
    """
    if current_thread() is not main_thread() or signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        yield
        return

    def end(_number: int, _frame: FrameType | None) -> None:
        end_line = "\n" if sys.stderr.isatty() else ""
        print(f"{end_line}positioner {command}: broken off; {known()}", file=sys.stderr, flush=True)
        sys.stdout.flush()
        os._exit(INTERRUPTED)

    before = signal.signal(signal.SIGINT, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)

"""Progress of long work on standard error: on a terminal one line, written over; in a log a line now and then."""

import sys
import time
from collections.abc import Callable
from typing import TextIO

SELDOM_S = 20.0
"""Time between two lines of a log; what is done sooner leaves none."""


class Progress:
    """What is being done, and the fraction of it done, as it is told.

    Args:
        stream: by default standard error.
        clock: time, s.
    """

    def __init__(self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> None:
        self._stream = stream or sys.stderr
        self._clock = clock
        self._told_s = clock()
        self._last = ""

    @property
    def known(self) -> str:
        """How far the work has come, in words."""
        return f"so far {self._last}; nothing was written" if self._last else "nothing was found or written yet"

    def __call__(self, what: str, done: float) -> None:
        """Tell what is being done and the fraction done."""
        self._last = f"{what}: {done:.0%}"
        if self._stream.isatty():
            bar = "#" * round(20 * done)
            end = "\n" if done >= 1.0 else ""
            print(f"\r\033[K{what} [{bar:<20}] {done:.0%}", end=end, file=self._stream, flush=True)
        elif (now_s := self._clock()) - self._told_s >= SELDOM_S:
            self._told_s = now_s
            print(f"{what}: {done:.0%}", file=self._stream, flush=True)

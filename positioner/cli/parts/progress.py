"""Progress of long work on standard error: on a terminal one line, written over; in a log a line now and then.

Within `with`, it is told that the work goes on even where nothing comes to an end for long, such as kernels that are
compiled at the first use of an effect: on a terminal every second, in a log after `SELDOM_S` without a line.
"""

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Lock, Thread
from typing import Self, TextIO

from positioner.cli.parts.breaking_off import tell_when_broken_off
from positioner.cli.parts.passing_line import passing

SELDOM_S, BEAT_S = 20.0, 1.0
"""Time between two lines of a log, what is done sooner leaves none; and between two looks at the clock."""


class Progress:
    """What is being done, and the fraction of it done, as it is told.

    Args:
        stream: by default standard error.
        clock: time, s.
        what: is being done, where no fraction of it is ever told.
    """

    def __init__(
        self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic, what: str = ""
    ) -> None:
        self._stream = stream or sys.stderr
        self._clock = clock
        self._began_s = self._told_s = clock()
        self._what: str = what
        self._done: float | None = None
        self._one_at_a_time, self._over = Lock(), Event()
        self._beats: Thread | None = None

    def __enter__(self) -> Self:
        """Say from now on that the work goes on."""
        self._beats = Thread(target=self._beat_on, name="progress", daemon=True)
        self._beats.start()
        return self

    def __exit__(self, *_raised: object) -> None:
        """Say so no longer."""
        self._over.set()
        if self._beats:
            self._beats.join()
        if self._stream.isatty() and (self._done is None or self._done >= 1.0):
            print(passing("", self._stream), end="", file=self._stream, flush=True)

    @property
    def known(self) -> str:
        """How far the work has come, in words."""
        return f"so far {self._last}; nothing was written" if self._what else "nothing was found or written yet"

    def __call__(self, what: str, done: float) -> None:
        """Tell what is being done and the fraction done."""
        with self._one_at_a_time:
            self._what, self._done = what, done
            if self._stream.isatty():
                self._redraw(end="\n" if done >= 1.0 else "")
            elif (now_s := self._clock()) - self._told_s >= SELDOM_S:
                self._tell(self._last, now_s)

    def beat(self) -> None:
        """Tell that the work goes on, where nothing has been told for long."""
        with self._one_at_a_time:
            now_s = self._clock()
            so_far = f"{now_s - self._began_s:.0f} s so far"
            if self._stream.isatty():
                self._redraw(said=f", {so_far}")
            elif now_s - self._told_s >= SELDOM_S:
                self._tell(f"{self._last or 'at work'}, {so_far}", now_s)

    @property
    def _last(self) -> str:
        return self._what if self._done is None else f"{self._what}: {self._done:.0%}"

    def _beat_on(self) -> None:
        while not self._over.wait(BEAT_S):
            self.beat()

    def _redraw(self, said: str = "", end: str = "") -> None:
        bar = "" if self._done is None else f" [{'#' * round(20 * self._done):<20}] {self._done:.0%}"
        print(passing(f"{self._what or 'at work'}{bar}{said}", self._stream), end=end, file=self._stream, flush=True)

    def _tell(self, line: str, now_s: float) -> None:
        self._told_s = now_s
        print(line, file=self._stream, flush=True)


@contextmanager
def at_work(command: str, what: str = "") -> Iterator[Progress]:
    """Tell that a command goes on, and that it was broken off at what it did.

    Args:
        command: of the person, as messages name it.
        what: it does, as in "reading rec.csv", if it has no fractions to tell.
    """
    progress = Progress(what=what)
    with tell_when_broken_off(command, lambda: progress.known), progress:
        yield progress

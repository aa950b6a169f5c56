"""One thread that keeps, for all valves: of each its health and what is known of it, looked at once a second in turn.

A thread each would be two a valve that ask for the interpreter beside its cycle. They are looked at one after another,
evenly over the second: so none waits for all the others, and no cycle for more than one.
"""

from collections.abc import Sequence
from itertools import cycle
from threading import Event, Thread
from typing import Protocol

from positioner.daemon.logs import logging_valve

EVERY_S = 1.0
WRITE_EVERY_CHECKS = 60
"""Looks of a keeper, after which its file is written at the latest."""


class Keeper(Protocol):
    """What is looked at, and its valve by its name in the log."""

    valve: str

    def check(self) -> None:
        """Look once."""
        ...


class Keeping:
    """A thread from `start` to `stop`; its death ends the daemon, as that of any."""

    def __init__(self, keepers: Sequence[Keeper]) -> None:
        self._keepers = tuple(keepers)
        self._stopping = Event()
        self._thread = Thread(target=self._work, name="keeping", daemon=True)

    def start(self) -> None:
        """Begin to look."""
        self._thread.start()

    def stop(self) -> None:
        """End; what is under way is finished."""
        self._stopping.set()
        self._thread.join()

    def _work(self) -> None:
        for each in cycle(self._keepers):
            if self._stopping.wait(EVERY_S / len(self._keepers)):
                return
            with logging_valve(each.valve):
                each.check()

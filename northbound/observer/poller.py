"""Polls a daemon as any Modbus client does, in a thread of its own: it reads and never writes.

What changes by the cycle is read every `POLL_S`, counts every quarter of a second, all the rest once a second; after a
failure all at once, for then the daemon may be another.
"""

import time
from collections.abc import Callable
from threading import Event, Thread

from config.errors import CommandFailed, InputError
from config.registers import COMMANDS, REGISTERS, STATUS
from northbound.observer.valve_view import ValveView
from positioner.dcs import Dcs

POLL_S = 0.05
COUNTS_EVERY = 5  # polls: counters change slowly
REST_EVERY = 20
"""Polls from one to the next."""
POLL_AGAIN_S = 0.25
REPLY_WITHIN_S = 0.5

LIVE = tuple(each.name for each in STATUS)
"""Read each time in one request: the reference that is asked for and the one in force are of one cycle."""
EACH_TIME = tuple(each.name for each in COMMANDS)
COUNTS = ("cycles", "missed_periods", "lost_samples", "lost_replies")
REST = tuple(each.name for each in REGISTERS if each.name not in {*LIVE, *EACH_TIME, *COUNTS})


class Poller:
    """Polls one valve from `start` to `stop`.

    Args:
        view: takes what is read.
        connect: returns a closed connection to the daemon.
    """

    def __init__(self, view: ValveView, connect: Callable[[], Dcs]) -> None:
        self.view = view
        self._connect = connect
        self._stopping = Event()
        self._thread = Thread(target=self._work, name=f"poller of {view.name}", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """End, and hang up."""
        self._stopping.set()
        self._thread.join()

    def _work(self) -> None:
        while not self._stopping.is_set():
            try:
                with self._connect() as dcs:
                    self._poll(dcs)
            except (CommandFailed, InputError) as failed:  # a certificate may be replaced meanwhile
                self.view.lose(time.monotonic(), str(failed))
            self._stopping.wait(POLL_AGAIN_S)

    def _poll(self, dcs: Dcs) -> None:
        """Poll until it fails or is stopped."""
        due_s, polls = time.monotonic(), 0
        while not self._stopping.is_set():
            values = dcs.get_all(*LIVE) | dcs.get_all(*names_of(polls))
            now_s = time.monotonic()
            self.view.take(now_s, values)
            due_s, polls = max(due_s + POLL_S, now_s), polls + 1
            self._stopping.wait(due_s - now_s)


def names_of(poll: int) -> tuple[str, ...]:
    """Return which registers a poll of a connection reads beside `LIVE`, counted from 0: the first reads all."""
    if poll == 0:
        return EACH_TIME + COUNTS + REST
    # The rest apart from the counts: no poll takes much longer than another.
    return EACH_TIME + COUNTS * (poll % COUNTS_EVERY == 0) + REST * (poll % REST_EVERY == 3)

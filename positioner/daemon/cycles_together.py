"""One thread that cycles many valves: it asks each device when its cycle is due, and takes answers as they come.

    due        ask the device; the answer is waited for with all others
    ready      take the answer, decide, publish
    too late   the same without an answer: a lost reply, of this valve alone

A thread for each valve hands the interpreter over twice a cycle, and finds its caches cold: of 64 valves at 100 Hz that
took two thirds of the processor. What cannot be done so, a device to be connected to or to be read back, waits for
replies: a helper does that cycle as a whole, and the others go on.
"""

import os
import time
from collections import deque
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from heapq import heappop, heappush
from selectors import EVENT_READ, DefaultSelector
from threading import Event, Lock

from positioner.daemon.backoff import AT_A_TIME
from positioner.daemon.cycle import Cycle
from positioner.daemon.pacing import RealTimePace, raise_priority

HELPERS = 3 * AT_A_TIME
"""Through each of the two doors so many connect at a time: the others are there for what is read back."""
SELECTS_S = 1e-3
"""The grain of waiting for descriptors; a shorter wait is slept, and answers are taken after it."""
SLOT_S = 2.5e-3
"""Cycles begin together in slots so far apart: their answers are taken one after another."""


@dataclass(slots=True)
class Turn:
    """One valve and its cycle under way."""

    cycle: Cycle
    pace: RealTimePace
    timeout_s: float
    missed: int = 0
    started_s: float = 0.0
    until_s: float = 0.0
    """When the time for its answer is over."""
    descriptor: int = -1
    asks: bool = False


class CyclesTogether:
    """All of them, from their first cycle to `stop`. Called by one thread, but for `wake`.

    Args:
        cycles: in real time, each with its pace, whose devices need not be waited for.
        stop: ends them; call `wake` then.
    """

    def __init__(self, cycles: Sequence[tuple[Cycle, RealTimePace]], stop: Event) -> None:
        self._turns = [Turn(cycle, pace, cycle.link.reply_timeout_s or 0.0) for cycle, pace in cycles]
        self._stop = stop
        self._heap: list[tuple[float, int]] = []
        self._asked: list[tuple[float, int]] = []
        self._done: deque[int] = deque()
        self._selector = DefaultSelector()
        self._woken, self._wakes = os.pipe()
        self._waking, self._ended = Lock(), False
        self._failed: BaseException | None = None

    def wake(self) -> None:
        """Have the thread look up."""
        with self._waking:
            if not self._ended:  # else the descriptor is somebody else's by now
                os.write(self._wakes, b" ")

    def run(self) -> None:
        """Cycle until `stop` is set."""
        self._selector.register(self._woken, EVENT_READ)
        try:
            with ThreadPoolExecutor(HELPERS, "cycle helper", raise_priority) as helpers:
                for number, turn in enumerate(self._turns):
                    turn.cycle.prepare()
                    self._next(number)
                while not self._stop.is_set():
                    self._begin_due(helpers)
                    self._take_answers()
        finally:
            self._selector.close()
            with self._waking:
                self._ended = True
                os.close(self._woken)
                os.close(self._wakes)

    def _next(self, number: int) -> None:
        turn = self._turns[number]
        turn.missed = turn.pace.next_due()
        heappush(self._heap, (turn.pace.due_s, number))

    def _begin_due(self, helpers: ThreadPoolExecutor) -> None:
        now_s = time.monotonic()
        while self._heap and self._heap[0][0] <= now_s:
            number = heappop(self._heap)[1]
            turn = self._turns[number]
            turn.started_s = now_s
            if (descriptor := turn.cycle.ask()) is None:
                self._forget(turn)
                helpers.submit(self._whole, number)
                continue
            if descriptor != turn.descriptor:
                self._forget(turn)
                self._selector.register(descriptor, EVENT_READ, number)
                turn.descriptor = descriptor
            turn.asks, turn.until_s = True, now_s + turn.timeout_s
            heappush(self._asked, (turn.until_s, number))

    def _take_answers(self) -> None:
        for key, _ in self._selector.select(self._wait_s()):
            number: int | None = key.data
            if number is None:
                os.read(self._woken, 512)
                continue
            turn = self._turns[number]
            if not turn.asks:
                self._forget(turn)  # the connection has ended, or says what it was not asked: the next cycle finds it
            elif turn.cycle.answer(late=False):
                self._over(number)
        self._give_up(time.monotonic())
        if self._failed is not None:
            raise self._failed
        while self._done:
            self._over(self._done.popleft())

    def _give_up(self, now_s: float) -> None:
        """End the cycles whose answers are too late."""
        while self._asked and (self._is_past(*self._asked[0]) or self._asked[0][0] <= now_s):
            until_s, number = heappop(self._asked)
            if not self._is_past(until_s, number):
                self._turns[number].cycle.answer(late=True)
                self._over(number)

    def _is_past(self, until_s: float, number: int) -> bool:
        """Whether what was to be answered until then was."""
        turn = self._turns[number]
        return not turn.asks or turn.until_s != until_s

    def _wait_s(self) -> float:
        """Return how long to wait for descriptors; sleep a wait that is shorter than that can be."""
        now_s = time.monotonic()
        until_s = min([each[0] for each in (*self._heap[:1], *self._asked[:1])], default=now_s + 1.0)
        rest_s = until_s - now_s
        if 0.0 < rest_s < SELECTS_S:
            time.sleep(rest_s)
            return 0.0
        return max(0.0, rest_s - SELECTS_S)

    def _over(self, number: int) -> None:
        turn = self._turns[number]
        turn.asks = False
        if not turn.cycle.link.is_connected:  # its descriptor is the next connection's, whoever's that is
            self._forget(turn)
        turn.cycle.statistics.enter(turn.started_s, time.monotonic() - turn.started_s, turn.missed)
        self._next(number)

    def _whole(self, number: int) -> None:
        """Run a cycle that waits, in a helper."""
        try:
            self._turns[number].cycle.whole()
        except BaseException as error:  # ends the daemon as if its own thread had died
            self._failed = error
        self._done.append(number)
        self.wake()

    def _forget(self, turn: Turn) -> None:
        if turn.descriptor >= 0:
            self._selector.unregister(turn.descriptor)
            turn.descriptor = -1

"""One thread that cycles many valves: none waits for another's device."""

import socket
from collections.abc import Callable
from threading import Event, Thread
from types import SimpleNamespace
from typing import Any

from positioner.daemon.cycle_statistics import CycleStatistics
from positioner.daemon.cycles_together import CyclesTogether
from positioner.daemon.pacing import RealTimePace

PERIOD_S, TIMEOUT_S = 0.005, 0.02
WITHIN_S = 60.0


class Asked:
    """A cycle whose device answers at once, never, or has to be waited for as a whole."""

    def __init__(self, *, silent: bool = False, whole: Callable[[], None] | None = None) -> None:
        self._here, self._device = socket.socketpair()
        self._silent, self._whole = silent, whole
        self.statistics = CycleStatistics(PERIOD_S)
        self.link = SimpleNamespace(reply_timeout_s=TIMEOUT_S, is_connected=True)
        self.answers: list[bool] = []
        self.enough = Event()

    def prepare(self) -> None:
        pass

    def ask(self) -> int | None:
        if self._whole is not None:
            return None
        if not self._silent:
            self._device.send(b"answer")
        return self._here.fileno()

    def answer(self, *, late: bool) -> bool:
        if not late:
            assert self._here.recv(16) == b"answer"
        self.answers.append(late)
        if len(self.answers) == 20:
            self.enough.set()
        return True

    def whole(self) -> None:
        assert self._whole is not None
        self._whole()

    def close(self) -> None:
        self._here.close()
        self._device.close()


def run(cycles: list[Asked], until: Callable[[], bool]) -> None:
    """Cycle them in a thread of its own until something has come about."""
    stop = Event()
    paced: list[Any] = [(each, RealTimePace(PERIOD_S)) for each in cycles]
    together = CyclesTogether(paced, stop)
    thread = Thread(target=together.run)
    thread.start()
    try:
        assert until()
    finally:
        stop.set()
        together.wake()
        thread.join(WITHIN_S)
        for each in cycles:
            each.close()
    assert not thread.is_alive()


def test_a_device_that_is_silent_loses_its_own_replies_alone() -> None:
    good, silent, other = Asked(), Asked(silent=True), Asked()
    run([good, silent, other], lambda: all(each.enough.wait(WITHIN_S) for each in (good, silent, other)))
    assert not any(good.answers)
    assert not any(other.answers)
    assert all(silent.answers)


def test_while_a_device_is_connected_to_the_others_go_on() -> None:
    good = Asked()
    reached: list[bool] = []
    away = Asked(whole=lambda: reached.append(good.enough.wait(WITHIN_S)))
    run([away, good], lambda: good.enough.wait(WITHIN_S))
    assert reached[0], "it was still waited for when the other had cycled twenty times"
    assert away.statistics.cycles <= good.statistics.cycles


def test_a_cycle_that_breaks_down_in_a_helper_ends_the_thread() -> None:
    def breaks() -> None:
        raise RuntimeError("a driver that is not ours")

    stop = Event()
    paced: list[Any] = [(each, RealTimePace(PERIOD_S)) for each in (Asked(whole=breaks), Asked())]
    failed: list[BaseException] = []

    def cycling() -> None:
        try:
            CyclesTogether(paced, stop).run()
        except RuntimeError as error:
            failed.append(error)

    thread = Thread(target=cycling)
    thread.start()
    thread.join(WITHIN_S)
    stop.set()
    assert [str(each) for each in failed] == ["a driver that is not ours"]
    for cycle, _ in paced:
        cycle.close()

"""Processes that share the valves of a daemon: each is the daemon of some, and is asked for their registers from here.

    client  ->  server, roles, counts (here)  ->  registers of the unit (its worker)      a request, then its answer
    worker  ->  writes, "ready", "all cycles turn", what keeps it from starting           news, when there are any

A worker that ends, or whose cycles turn no more, is said and started anew, after a while that grows with its failures.
What its valves do meanwhile their devices decide, by their own communication time-outs, as after the end of any daemon.
It then begins as any daemon does: it holds what the device has, in mode hold. Until it serves again its units answer
with exception 11, the device behind the gateway does not respond; so does one that a busy machine keeps from answering
within `ANSWER_WITHIN_S`, until it has. A worker whose daemon is gone ends as if it was told.

Both ends are this file; a worker is `python -P -m positioner.daemon.workers`.
"""

import logging
import os
import pickle
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
from threading import Lock, Thread
from typing import NamedTuple

from pymodbus.constants import ExcCodes

from config.errors import InputError
from fieldbus.modbus.function_codes import RegisterError, Registers, Table
from fieldbus.modbus.request_counts import RequestCounts
from positioner.daemon.assembled_valves import AssembledValves, Share
from positioner.daemon.end_signals import Endings
from positioner.daemon.history import HistoryKeeper
from positioner.daemon.history.audited_writes import Told
from positioner.daemon.logs import log_event, start_logging
from positioner.daemon.service_manager import Turns

log = logging.getLogger(__name__)

ANSWER_WITHIN_S = 0.5
"""Of a worker: asking it takes a millisecond, and a client that waits no longer asks others' valves."""
TURNED_EVERY_S = 0.25
STANDS_S = 5.0
"""Without news that all cycles turn, and so many of its slowest cycles: then it is killed."""
SLOWEST_CYCLES = 5.0
LOOK_S = 0.05
FIRST_S, LONGEST_S = 0.5, 60.0
"""Wait before one is started again: after its first failure, and at the most."""
SERVED_LONG_S = 60.0
"""Who served for so long has made up for its failures."""
ENDING_S = 20.0
"""That a worker has to leave its valves, and that of a slow device besides."""
READY, TURNED = "ready", "turned"
BEGIN = "begin"
GONE = "the daemon is gone"
News = Told | InputError | str


class Call(NamedTuple):
    """What is asked of a unit's registers: to write where there are words, and else to read."""

    unit: int
    table: Table
    address: int
    size: int
    words: Sequence[int]
    peer: str
    counts: Mapping[str, int]


class Workers:
    """All of them, from their start to their end.

    Args:
        shares: of each.
        counts: of requests, which the registers show.
        tell: takes the writes of clients.
        on_exit: ends those that it starts.

    Raises:
        InputError: one of them cannot begin.
    """

    def __init__(
        self, shares: Sequence[Share], counts: RequestCounts, tell: Callable[[Told], None], on_exit: ExitStack
    ) -> None:
        self.workers = [Worker(share, counts, tell) for share in shares]
        self._looks = 0
        for each in self.workers:
            on_exit.callback(each.kill)
            each.start()
        for each in self.workers:
            each.await_ready()
        self.registers: Mapping[int, Registers] = {
            file.supervisory.unit: RegistersElsewhere(each, file.supervisory.unit)
            for each, share in zip(self.workers, shares, strict=True)
            for file in share.files
        }

    def begin(self) -> None:
        """Have all cycle."""
        for each in self.workers:
            each.begin()

    def look(self, wait_s: float) -> None:
        """Wait for news; start again who has ended."""
        wait([each.news for each in self.workers if each.news is not None], wait_s)
        for each in self.workers:
            each.look()
        self._looks += 1

    @property
    def turns(self) -> list[int]:
        """How often it was looked whether they stand: they are this process's to watch, and this one is others'."""
        return [self._looks]

    def end(self, endings: Endings) -> None:
        """Tell all to end, and wait until they have."""
        for each in self.workers:
            each.tell_to_end(endings.signal)
        until_s = time.monotonic() + ENDING_S + max(each.slowest_s for each in self.workers)
        for each in self.workers:
            each.wait_for_the_end(until_s)


class Worker:
    """This side of one process."""

    def __init__(self, share: Share, counts: RequestCounts, tell: Callable[[Told], None]) -> None:
        self.news: Connection | None = None
        self.turns = 0
        self.slowest_s = max(max(each.cycle.period_s, each.device.longest_exchange_s) for each in share.files)
        self._share = share
        self._names = ", ".join(each.valve.name for each in share.files)
        self._counts = counts
        self._tell = tell
        self.process: subprocess.Popen[bytes] | None = None
        self._calls: Connection | None = None
        self._asking = Lock()
        self._unanswered = 0
        self._may_begin = self._is_ready = self._serves = self._is_to_end = False
        self._begun_s = self._turned_s = self._again_s = 0.0
        self.failures = 0
        self._fault: InputError | None = None

    def start(self) -> None:
        """Start the process: it opens its devices, and waits until it may begin."""
        self._fault = None
        calls, its_calls = Pipe()
        news, its_news = Pipe(duplex=False)
        ends = (its_calls.fileno(), its_news.fileno())
        with its_calls, its_news, tempfile.TemporaryFile() as share:
            pickle.dump(self._share, share)
            share.seek(0)
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "positioner.daemon.workers", *map(str, ends)],
                stdin=share,
                pass_fds=ends,
                start_new_session=True,  # a terminal's Ctrl-C is for the daemon
            )
        self.news = news
        with self._asking:
            self._calls, self._unanswered = calls, 0

    def await_ready(self) -> None:
        """Wait until it may begin.

        Raises:
            InputError: it cannot begin.
        """
        while not self._is_ready:
            if self.news is None:
                raise self._fault or InputError(str(self._share.source), f"the process of {self._names} has ended")
            wait([self.news], LOOK_S)
            self._hear()

    def begin(self) -> None:
        """Have it cycle, now and whenever it is started again."""
        self._may_begin = True
        if self._is_ready and self._calls is not None:
            with suppress(OSError):  # it has ended: its news will tell
                self._calls.send(BEGIN)
            self._begun_s = self._turned_s = time.monotonic()
            self._serves = True

    def look(self) -> None:
        """Take its news; start it again where it has ended, kill it where it stands."""
        now_s = time.monotonic()
        if self.news is not None:
            self._hear()
            stands_s = max(STANDS_S, SLOWEST_CYCLES * self.slowest_s)
            if self._serves and self.process is not None and now_s - self._turned_s > stands_s:
                log_event(log, logging.ERROR, "a worker's cycles stand", valves=self._names, pid=self.process.pid)
                self.process.kill()
                self._turned_s = now_s  # its end is heard of with a later look, and said once
        elif now_s >= self._again_s:
            try:
                self.start()
            except OSError as error:  # no room for it: memory, descriptors, a disk
                self._put_off(str(error))

    def ask(self, call: Call) -> Sequence[int]:
        """Return what the registers of a unit answer.

        Raises:
            RegisterError: they refuse; GATEWAY_NO_RESPONSE, the process does not answer.
        """
        with self._asking:
            try:
                answer = self._answer(call)
            except (OSError, EOFError, pickle.UnpicklingError):
                raise RegisterError(ExcCodes.GATEWAY_NO_RESPONSE) from None
        if isinstance(answer, ExcCodes):
            raise RegisterError(answer)
        return answer

    def tell_to_end(self, signal: int) -> None:
        """Have it leave its valves in their safe states."""
        self._is_to_end = True
        if self.process is not None:
            self.process.send_signal(signal)

    def wait_for_the_end(self, until_s: float) -> None:
        """Wait for it, but no longer."""
        if self.process is None:
            return
        try:
            self.process.wait(max(until_s - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            log_event(log, logging.ERROR, "a worker does not end, and is killed", valves=self._names)
        if self.news is not None:
            self._hear()
        self.kill()

    def kill(self) -> None:
        """Make sure that it is gone."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
        self._forget()

    def _answer(self, call: Call) -> Sequence[int] | ExcCodes:
        """Send a call, once all before it are answered, and return its answer.

        Raises:
            OSError, EOFError, UnpicklingError: the process is gone, or does not answer in time.
        """
        calls = self._calls
        if calls is None or not self._serves:
            raise EOFError
        while self._unanswered and calls.poll():
            calls.recv()
            self._unanswered -= 1
        if self._unanswered:
            raise TimeoutError
        calls.send(Call(call.unit, call.table, call.address, call.size, call.words, call.peer, self._counts.all))
        self._unanswered += 1
        if not calls.poll(ANSWER_WITHIN_S):
            log_event(log, logging.WARNING, "a worker answers late", valves=self._names, waited_s=ANSWER_WITHIN_S)
            raise TimeoutError
        answer: Sequence[int] | ExcCodes = calls.recv()
        self._unanswered -= 1
        return answer

    def _hear(self) -> None:
        """Take what it has to say."""
        while self.news is not None:
            try:
                if not self.news.poll():
                    return
                news: News = self.news.recv()
            except (OSError, EOFError, pickle.UnpicklingError):
                self._note_the_end()
                return
            if isinstance(news, InputError):
                self._fault = news
            elif isinstance(news, Told):
                self._tell(news)
            elif news == READY:
                self._is_ready = True
                pid = None if self.process is None else self.process.pid
                log_event(log, logging.INFO, "a worker is ready", valves=self._names, pid=pid)
                if self._may_begin:
                    self.begin()
            elif news == TURNED:
                self._turned_s = time.monotonic()
                self.turns += 1

    def _note_the_end(self) -> None:
        """Take note that it has ended."""
        process, status = self.process, None
        if process is not None:
            process.kill()  # it has closed its end, so it ends, or is broken
            status = process.wait()
        if not self._is_to_end:
            self._put_off(str(self._fault) if self._fault is not None else f"status {status}")
        self._forget()

    def _put_off(self, reason: str) -> None:
        """Say why it is away, and when it is started again."""
        now_s = time.monotonic()
        if self._serves and now_s - self._begun_s > SERVED_LONG_S:
            self.failures = 0
        wait_s = min(FIRST_S * 2.0**self.failures, LONGEST_S)
        self.failures += 1
        self._again_s = now_s + wait_s
        told = {"valves": self._names, "reason": reason, "started_again_after_s": wait_s}
        log_event(log, logging.ERROR, "a worker has ended", **told)

    def _forget(self) -> None:
        with self._asking:
            calls, self._calls, self._is_ready, self._serves = self._calls, None, False, False
        news, self.news, self.process = self.news, None, None
        for each in (calls, news):
            if each is not None:
                each.close()


class RegistersElsewhere:
    """The registers of a unit whose valve a worker runs: a `Registers`."""

    def __init__(self, worker: Worker, unit: int) -> None:
        self._worker = worker
        self._unit = unit

    def read(self, table: Table, address: int, count: int) -> Sequence[int]:
        """Return words of one moment.

        Raises:
            RegisterError: ILLEGAL_ADDRESS; GATEWAY_NO_RESPONSE, the worker is away.
        """
        return self._worker.ask(Call(self._unit, table, address, count, (), "", {}))

    def write(self, address: int, words: Sequence[int], peer: str) -> None:
        """Write, all or nothing.

        Raises:
            RegisterError: as they refuse; GATEWAY_NO_RESPONSE, the worker is away, or nobody knows whether it took it.
        """
        self._worker.ask(Call(self._unit, "holding", address, len(words), tuple(words), peer, {}))


class _Voice:
    """What a worker's threads say to the daemon, one at a time."""

    def __init__(self, news: Connection) -> None:
        self._news = news
        self._lock = Lock()

    def say(self, news: News) -> None:
        """Say it; to nobody where the daemon is gone."""
        with self._lock, suppress(OSError):
            self._news.send(news)


def _work(calls: Connection, voice: _Voice, share: Share) -> int:
    """Be the daemon for a share until a signal, or the end of the daemon; return the exit status."""
    endings, counts, turns = Endings(), RequestCounts(), Turns(TURNED_EVERY_S)
    (first, *_), status = share.files, 0
    with ExitStack() as on_exit:
        on_exit.callback(start_logging(first.log.level).stop)
        history = HistoryKeeper(first.history, share.source.parent, voice.say)
        on_exit.callback(lambda: history.stop(endings.reason or "it could not start"))
        served = AssembledValves(share, counts, history, on_exit)
        history.start()
        voice.say(READY)
        if _may_begin(calls, endings):
            asked = (calls, served.registers, counts, endings)
            Thread(target=_answer, args=asked, name="registers", daemon=True).start()
            try:
                served.begin()
                while not endings.came:
                    served.look(LOOK_S)
                    if turns.all_have(served.turns, time.monotonic()):
                        voice.say(TURNED)
            finally:
                served.end(endings)
        status = endings.status
        log_event(log, logging.INFO, "stopped", status=status, reason=endings.reason)
    return status


def _may_begin(calls: Connection, endings: Endings) -> bool:
    """Wait until the daemon has it begin; return whether it does."""
    while not endings.came:
        if calls.poll(LOOK_S):
            try:
                return bool(calls.recv() == BEGIN)
            except (OSError, EOFError):
                endings.tell(GONE)
    return False


def _answer(calls: Connection, registers: Mapping[int, Registers], counts: RequestCounts, endings: Endings) -> None:
    """Answer what the daemon asks, until it is gone."""
    while True:
        try:
            call: Call = calls.recv()
            counts.take(call.counts)
            calls.send(_answered(registers[call.unit], call))
        except (OSError, EOFError):
            endings.tell(GONE)
            return


def _answered(registers: Registers, call: Call) -> Sequence[int] | ExcCodes:
    try:
        if not call.words:
            return registers.read(call.table, call.address, call.size)
        registers.write(call.address, call.words, call.peer)
    except RegisterError as refusal:
        return refusal.code
    except Exception:
        log.exception("request of %s failed", call.peer)
        return ExcCodes.DEVICE_FAILURE
    return ()


def main() -> int:
    """Be a worker: its share comes on standard input, its ends of calls and news are the arguments."""
    calls, news = (Connection(int(each)) for each in sys.argv[1:])
    voice = _Voice(news)
    share: Share = pickle.load(sys.stdin.buffer)
    devnull = os.open(os.devnull, os.O_RDONLY)
    os.dup2(devnull, 0)
    os.close(devnull)
    try:
        return _work(calls, voice, share)
    except InputError as error:
        voice.say(error)
        return 2


if __name__ == "__main__":
    sys.exit(main())

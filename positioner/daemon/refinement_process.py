"""The process that refines: one beside the daemon, for all its valves, so that no fit ever takes a cycle's time.

A job goes down a pipe, its result comes back up another, pickled: both ends are this file. A thread waits for it; the
control thread only looks whether a result lies there. Jobs of several valves are done one after another. The process
is started at once, and does a small job of its own first, so that the first window is answered as fast as any. It is
as nice as can be and leaves the terminal's Ctrl-C to the daemon; it ends when its pipe does. If it dies, or does not
answer for `ANSWER_WITHIN_S`, the job is refused and the algebraic estimates stand; one line in the log says so, and the
process is started again for a later job, ever more seldom while it goes on failing.

    python -P -m positioner.daemon.refinement_process      is what it runs; with -P, a `config.py` in the current
    folder is not taken for ours
"""

import logging
import math
import os
import pickle
import select
import signal
import subprocess
import sys
import time
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Event, Thread
from typing import IO, cast

import numpy as np

from positioner.daemon.logs import log_event
from positioner.estimation.batch import BatchResult, BatchSettings
from positioner.estimation.refiner import RefinementJob

log = logging.getLogger(__name__)

LONGEST_WAIT_S = 10.0
"""That a patient refiner waits for a result."""
ANSWER_WITHIN_S = 120.0
"""Of the process; a job takes a second or two."""
FIRST_S, LONGEST_S = 1.0, 300.0
"""Wait before it is started again: after the first failure, and at the most."""
MOST_FAILURES = 16
LOOK_EVERY_S = 1.0
"""How often it is looked at while there is no job."""
ENDING_S = 2.0
"""Time the process has to end by itself."""


class RefinementProcess:
    """The process, and the thread that speaks with it. Made once; `refiner` gives each valve its own side.

    Attributes:
        child: the process; None where there is none.
        again_s: when it may be started again, on the monotonic clock.
    """

    def __init__(self) -> None:
        self.child: subprocess.Popen[bytes] | None = None
        self._jobs: SimpleQueue[tuple[ProcessRefiner, RefinementJob] | None] = SimpleQueue()
        self._failures = 0
        self.again_s = -math.inf
        self._thread = Thread(target=self._serve, name="refinement", daemon=True)
        self._thread.start()

    def refiner(self, *, blocking: bool = False) -> "ProcessRefiner":
        """Return a side for one valve; a patient one waits for its results, as a device in lockstep does."""
        return ProcessRefiner(self, blocking=blocking)

    def stop(self) -> None:
        """End the process."""
        self._jobs.put(None)
        self._thread.join(ENDING_S)
        if self._thread.is_alive():  # it waits for an answer: none will come
            process = self.child
            if process is not None:
                process.kill()
            self._thread.join(ENDING_S)

    @property
    def alive(self) -> bool:
        """Whether it takes jobs: it runs, or is to be started again."""
        return time.monotonic() >= self.again_s

    def put(self, refiner: "ProcessRefiner", job: RefinementJob) -> None:
        """Queue a job."""
        self._jobs.put((refiner, job))

    def _started(self) -> "subprocess.Popen[bytes]":
        one_core = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "positioner.daemon.refinement_process"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,
            env={**os.environ, **one_core},
        )

    def _serve(self) -> None:
        """Start the process, and hand it one job after another; start it again where it is gone."""
        self.child = self._started()
        while (task := self._next()) is not None:
            refiner, job = task
            result = None
            try:
                result = self._done(job)
                self._failures = 0
            except (OSError, EOFError, pickle.UnpicklingError) as error:
                self.give_up(str(error) or "it ended")
            refiner.deliver(result)
        self._close()

    def _next(self) -> "tuple[ProcessRefiner, RefinementJob] | None":
        """Return the next job, None at the end. A process that has ended meanwhile is said, and nothing left of it."""
        while True:
            with suppress(Empty):
                return self._jobs.get(timeout=LOOK_EVERY_S)
            if self.child is not None and self.child.poll() is not None:
                self.give_up(f"it ended by itself, {_ended(self.child.returncode)}")

    def _done(self, job: RefinementJob) -> BatchResult | None:
        """Have a job done.

        Raises:
            OSError, EOFError, UnpicklingError: the process is gone, or does not answer.
        """
        if self.child is None:
            self.child = self._started()
        down, up = cast(IO[bytes], self.child.stdin), cast(IO[bytes], self.child.stdout)
        pickle.dump(job, down)
        down.flush()
        if not select.select((up,), (), (), ANSWER_WITHIN_S)[0]:
            raise OSError(f"it does not answer within {ANSWER_WITHIN_S:g} s")
        result: BatchResult | None = pickle.load(up)
        return result

    def give_up(self, reason: str) -> None:
        """End what is left of the process; it is not started again for a while."""
        wait_s = min(FIRST_S * 2.0**self._failures, LONGEST_S)
        self._failures = min(self._failures + 1, MOST_FAILURES)
        self.again_s = time.monotonic() + wait_s
        log_event(log, logging.ERROR, "the refinement process is gone", reason=reason, again_after_s=wait_s)
        self._close()

    def _close(self) -> None:
        process, self.child = self.child, None
        if process is None:
            return
        with suppress(OSError), cast(IO[bytes], process.stdin), cast(IO[bytes], process.stdout):
            process.terminate()  # it may be starting still, and holds nothing that would be lost
        try:
            process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            process.kill()  # a stopped one does not end by being asked
            process.wait()


def _ended(status: int) -> str:
    return f"status {status}" if status >= 0 else signal.strsignal(-status) or f"signal {-status}"


class ProcessRefiner:
    """One valve's side: a `Refiner`."""

    def __init__(self, process: RefinementProcess, *, blocking: bool) -> None:
        self._process = process
        self._blocking = blocking
        self._ready = Event()
        self._result: BatchResult | None = None
        self._pending = False

    @property
    def pending(self) -> bool:
        """Whether a result is still to come."""
        return self._pending

    def submit(self, job: RefinementJob) -> bool:
        """Send a job; False when one is under way or the process is gone."""
        if self._pending or not self._process.alive:
            return False
        self._ready.clear()
        self._pending = True
        self._process.put(self, job)
        return True

    def collect(self) -> BatchResult | None:
        """Return the result, once."""
        if not self._pending:
            return None
        if not (self._ready.wait(LONGEST_WAIT_S) if self._blocking else self._ready.is_set()):
            return None
        result, self._result = self._result, None
        self._pending = False
        return result

    def deliver(self, result: BatchResult | None) -> None:
        """Take a result from the process; None when there will be none."""
        self._result = result
        self._ready.set()


def _warm_up() -> None:
    """Do a small job, of a jump's answer: what is loaded at first use is loaded then."""
    time_s = np.arange(0.0, 0.2, 1e-3)
    pressure_pa = np.where(time_s > 0.05, 1.0, 0.0)
    moved = np.maximum(time_s - 0.05, 0.0)
    RefinementJob(time_s, moved**2, pressure_pa, BatchSettings(noise_std_m=1e-5, pressure_held=True)).run()


def _work() -> None:
    """Do the jobs that come down the pipe until it closes."""
    os.nice(19)
    _warm_up()
    down, up = sys.stdin.buffer, sys.stdout.buffer
    while True:
        try:
            job: RefinementJob = pickle.load(down)
        except EOFError:
            return
        result: BatchResult | None
        try:
            result = job.run()
        except (ArithmeticError, ValueError) as error:  # numpy.linalg.LinAlgError is a ValueError
            print(f"refinement failed: {error}", file=sys.stderr)
            result = None
        pickle.dump(result, up)
        up.flush()


if __name__ == "__main__":
    _work()

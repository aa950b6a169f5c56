"""Examinations on many processors: Dask's scheduler and workers, of this machine or of a cluster.

Each valve is a course of examinations, one after another; valves go on side by side. A task is a recording's path and a
model, it reads and computes and writes nothing: a worker that is killed has its tasks given to another, and a recording
that kills three workers is given up with its reason. So is one that takes longer than a limit: its worker is restarted,
as a thread that computes can be stopped by nobody. No more is sent than there are threads: what waited at a worker
behind another would be lost with it. What comes back is taken by the client alone.

A cluster of this machine listens on 127.0.0.1 and speaks TLS with certificates made for this run: what a scheduler is
sent, it executes.
"""

import logging
import os
import tempfile
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib.metadata import version
from threading import Event, Thread
from typing import Any, Protocol

from config.errors import CommandFailed, InputError
from config.extras import import_extra
from workbench.fleet.examination import Examination, Request, examine, unreadable

WHO = "positioner fleet"
CONNECT_WITHIN_S = 10
TIME_LIMIT_S = 900.0
RESTART_WITHIN_S = 60
LOOK_EVERY_S = 1.0
"""At what is under way; with a limit of less than twenty of these, oftener."""
SETTINGS = {"distributed.scheduler.http.routes": [], "distributed.deploy.lost-worker-timeout": "10 minutes"}
"""The scheduler serves no pages; a worker that was killed is waited for, however slowly one starts anew."""
GONE = "the scheduler is gone; what was examined is kept: the same command goes on from there"


class Course(Protocol):
    """What gives the next request once it has taken the answer to the last; None: it is through."""

    def following(self) -> Request | None:
        """Return the next request."""
        ...

    def take(self, found: Examination) -> None:
        """Go on with the answer."""
        ...


@contextmanager
def cluster(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """Give a client of a scheduler; without an address, of one that runs with its workers while this lasts.

    Raises:
        InputError: nobody answers at the address, or its workers are none of ours.
        ModuleNotFoundError: Dask is not installed; names the extra.
    """
    distributed = import_extra("distributed", WHO)
    import_extra("dask", WHO).config.set(SETTINGS)
    if scheduler is not None:
        logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # a scheduler that goes is told in one line
        try:
            client = distributed.Client(scheduler, timeout=CONNECT_WITHIN_S)
        except (OSError, ValueError) as error:
            raise InputError(scheduler, f"no scheduler answers there: {' '.join(str(error).split())}") from None
        with client:
            _require_same_rules(client, scheduler)
            yield client
        return
    with (
        tempfile.TemporaryDirectory(prefix="positioner-fleet-") as folder,
        distributed.LocalCluster(
            n_workers=workers or os.cpu_count(),
            threads_per_worker=1,
            host="127.0.0.1",
            security=distributed.Security.temporary(),
            dashboard_address="127.0.0.1:0",
            preload=["workbench.fleet.examination"],
            local_directory=folder,
            silence_logs=50,
        ) as local,
        distributed.Client(local) as client,
    ):
        yield client


def own_version() -> str:
    """Return which positioner this process has."""
    return version("positioner")


def _require_same_rules(client: Any, scheduler: str) -> None:
    """See that there are workers, and that they would examine as this machine does.

    Raises:
        InputError: they would not.
    """
    try:
        theirs = set(client.run(own_version).values())
    except Exception as error:  # whatever a worker without our packages comes to
        problem = f"its workers have no positioner[sim,fleet]: {type(error).__name__}: {error}"
        raise InputError(scheduler, " ".join(problem.split())) from None
    if theirs != {own_version()}:
        there = ", ".join(sorted(theirs)) or "no workers"
        raise InputError(scheduler, f"has {there}; allowed are workers with positioner {own_version()}")


def work(client: Any, courses: Sequence[Course], time_limit_s: float = TIME_LIMIT_S) -> None:
    """Carry all courses to their ends.

    Args:
        client: of the cluster.
        courses: which go on side by side.
        time_limit_s: for one examination; one that takes longer is given up.

    Raises:
        CommandFailed: the scheduler is gone.
    """
    distributed = import_extra("distributed", WHO)
    waiting = deque(courses)
    under_way: dict[str, tuple[Course, Any]] = {}
    answers = distributed.as_completed()
    count = 0

    def fill() -> None:
        nonlocal count
        most = max(sum(client.nthreads().values()), 1)
        while waiting and len(under_way) < most:
            course = waiting.popleft()
            request = course.following()
            if request is not None:
                count += 1
                future = client.submit(examine, request, key=f"examine-{count}-{request.key}", pure=False)
                under_way[future.key] = course, future
                answers.add(future)

    with tell_when_gone(), _limit_time(client, time_limit_s, lambda key: under_way[key][1].cancel()) as overdue:
        fill()
        for future in answers:
            course, _ = under_way.pop(future.key)
            course.take(answer_of(future, overdue, time_limit_s))
            waiting.appendleft(course)
            fill()


@contextmanager
def _limit_time(client: Any, time_limit_s: float, give_up: Callable[[str], None]) -> Iterator[set[str]]:
    """Give up what is under way for longer than a limit, on a thread of its own; gives the keys of what was."""
    clocks, overdue, ended = TaskClocks(), set[str](), Event()

    def look() -> None:
        clocks.look(client.processing(), client.nthreads(), time.monotonic())
        for worker, key in clocks.late(time.monotonic() - time_limit_s):
            overdue.add(key)
            give_up(key)
            client.restart_workers([worker], timeout=RESTART_WITHIN_S, raise_for_error=False)

    def watch() -> None:
        while not ended.wait(min(LOOK_EVERY_S, time_limit_s / 20.0)):
            try:
                look()
            except (OSError, CancelledError, KeyError, ValueError):  # a scheduler or a worker is gone: others tell
                continue

    thread = Thread(target=watch, daemon=True)
    thread.start()
    try:
        yield overdue
    finally:
        ended.set()
        thread.join(CONNECT_WITHIN_S)


class TaskClocks:
    """Since when each task runs: of those at a worker, as many as it has threads, those that came first."""

    def __init__(self) -> None:
        self._came_s: dict[tuple[str, str], float] = {}
        self._runs_since_s: dict[tuple[str, str], float] = {}

    def look(self, at_workers: Mapping[str, Sequence[str]], threads: Mapping[str, int], now_s: float) -> None:
        """See which tasks are at which worker."""
        there = [(worker, key) for worker, keys in at_workers.items() for key in keys]
        self._came_s = {each: self._came_s.get(each, now_s) for each in there}
        running = [
            each
            for worker, count in threads.items()
            for each in sorted((each for each in there if each[0] == worker), key=self._came_s.__getitem__)[:count]
        ]
        self._runs_since_s = {each: self._runs_since_s.get(each, now_s) for each in running}

    def late(self, time_s: float) -> list[tuple[str, str]]:
        """Return worker and key of what runs since before a time."""
        return [each for each, since_s in self._runs_since_s.items() if since_s < time_s]


@contextmanager
def tell_when_gone() -> Iterator[None]:
    """Say so in one line where the connection to the scheduler ends, at whatever it is asked.

    Raises:
        CommandFailed: it does.
    """
    try:
        yield
    except (OSError, CancelledError):  # Dask's own errors of a closed connection are among the first
        raise CommandFailed(GONE) from None


def answer_of(future: Any, overdue: set[str], time_limit_s: float) -> Examination:
    """Return what a task came to, or why there is no answer."""
    if future.status == "finished":
        found: Examination = future.result()
        return found
    if future.key in overdue:
        return unreadable(f"not examined within {time_limit_s:g} s")
    if future.status in {"cancelled", "lost"}:
        raise CancelledError
    error = future.exception()
    if type(error).__name__ == "KilledWorker":
        return unreadable("the workers that examined it died")
    return unreadable(f"{type(error).__name__}: {error}")

"""Examinations on many processors: Dask's scheduler and workers, of this machine or of a cluster.

Each valve is a course of examinations, one after another; valves go on side by side. A task is a recording's path and a
model, it reads and computes and writes nothing: a worker that is killed has its tasks given to another, and a recording
that kills three workers is given up with its reason. What comes back is taken by the client alone.

A cluster of this machine listens on 127.0.0.1 and speaks TLS with certificates made for this run: what a scheduler is
sent, it executes.
"""

import logging
import os
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib.metadata import version
from typing import Any, Protocol

from config.errors import CommandFailed, InputError
from config.extras import needed
from workbench.fleet.examination import Examination, Request, examine, unreadable

WHO = "positioner fleet"
CONNECT_WITHIN_S = 10
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
    distributed = needed("distributed", WHO)
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
            dashboard_address=None,
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


def work(client: Any, courses: Sequence[Course]) -> None:
    """Carry all courses to their ends.

    Raises:
        CommandFailed: the scheduler is gone.
    """
    distributed = needed("distributed", WHO)
    under_way: dict[str, Course] = {}
    answers = distributed.as_completed()

    def go_on(course: Course) -> None:
        request = course.following()
        if request is not None:
            future = client.submit(examine, request, key=f"{len(under_way)}-{id(course)}-{request.key}", pure=False)
            under_way[future.key] = course
            answers.add(future)

    with _told_when_gone():
        for course in courses:
            go_on(course)
        for future in answers:
            course = under_way[future.key]
            course.take(_answer(future))
            go_on(course)


@contextmanager
def _told_when_gone() -> Iterator[None]:
    """Say so in one line where the connection to the scheduler ends, at whatever it is asked.

    Raises:
        CommandFailed: it does.
    """
    try:
        yield
    except (OSError, CancelledError):  # Dask's own errors of a closed connection are among the first
        raise CommandFailed(GONE) from None


def _answer(future: Any) -> Examination:
    if future.status == "finished":
        found: Examination = future.result()
        return found
    if future.status in {"cancelled", "lost"}:
        raise CancelledError
    error = future.exception()
    if type(error).__name__ == "KilledWorker":
        return unreadable("the workers that examined it died")
    return unreadable(f"{type(error).__name__}: {error}")

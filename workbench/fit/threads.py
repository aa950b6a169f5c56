"""Searches on threads: the simulation holds no interpreter lock.

Each search is on one thread. The linear algebra of a descent is of few columns: given threads of its own, these would
mostly wait for each other and take the processors from the searches.
"""

from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from os import cpu_count
from threading import Event
from typing import TypeVar

from threadpoolctl import ThreadpoolController

from workbench.fit.breaking_off import ending, over

T = TypeVar("T")
S = TypeVar("S")


def on_threads(function: Callable[[T], S], arguments: Sequence[T], workers: int | None) -> Generator[S, None, None]:
    """Apply a function to each argument on so many threads, by default one a core; results in their order.

    Where this one is left early, by Ctrl-C, say, the searches on the threads are broken off.
    """
    left, asked = Event(), over()

    def applied(argument: T) -> S:
        with ending(lambda: left.is_set() or asked()):
            return function(argument)

    with linear_algebra_alone(), ThreadPoolExecutor(workers or cpu_count()) as pool:
        try:
            yield from pool.map(applied, arguments)
        finally:
            left.set()


@contextmanager
def linear_algebra_alone() -> Iterator[None]:
    """Keep linear algebra to the thread that asks for it; a function decorated so keeps it so throughout."""
    with _linear_algebra().limit(limits=1, user_api="blas"):
        yield


@cache
def _linear_algebra() -> ThreadpoolController:
    return ThreadpoolController()

"""Searches side by side: results in order, linear algebra on one thread each, and all broken off at once."""

from contextlib import closing
from threading import Event

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from workbench.fit.breaking_off import BrokenOff, ending, go_on
from workbench.fit.threads import on_threads


def linear_algebra_threads() -> set[int]:
    return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}


def test_results_come_in_the_order_of_the_arguments() -> None:
    assert list(on_threads(lambda n: n * n, [3, 1, 2], 2)) == [9, 1, 4]


def test_linear_algebra_keeps_to_one_thread_meanwhile() -> None:
    assert np.linalg.norm(np.eye(2)) > 0.0
    with threadpool_limits(2, "blas"):
        outside = linear_algebra_threads()
        (inside,) = on_threads(lambda _: linear_algebra_threads(), [None], 1)
        assert inside == {1}
        assert linear_algebra_threads() == outside


def test_what_is_left_early_breaks_off_the_searches_on_all_threads() -> None:
    """As Ctrl-C leaves it: without, the pool would wait for a search of seconds."""
    begun, ended, never = Event(), Event(), Event()

    def searched(number: int) -> int:
        if number == 0:
            begun.wait()
            return 0
        begun.set()
        try:
            for _ in range(3000):
                go_on()
                never.wait(1e-3)
        except BrokenOff:
            ended.set()
            raise
        return 1

    with closing(on_threads(searched, [0, 1], 2)) as results:
        assert next(results) == 0
    assert ended.is_set()


def test_whoever_starts_searches_ends_them_on_their_threads() -> None:
    over = Event()

    def searched(_: int) -> None:
        over.set()
        go_on()

    with ending(over.is_set):
        go_on()
        with pytest.raises(BrokenOff):
            list(on_threads(searched, [0], 1))
        with pytest.raises(BrokenOff):
            go_on()
    go_on()

"""Searches side by side: results in order, and linear algebra on one thread each."""

import numpy as np
from threadpoolctl import threadpool_info, threadpool_limits

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

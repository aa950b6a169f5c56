"""How `make test` shares the suite out over workers: a file is one group, all that happens in real time is another.

A group runs on one worker, in order. So a file's valves, fits and processes are made once, and no two tests that wait
for a clock, a process or a wire ever wait for each other. See tests/README.md.
"""

import os

import pytest

REAL_TIME = "real_time"
MOST_PROCESSORS = 4
"""More would not end sooner: what happens in real time takes the longest then."""


def pytest_xdist_auto_num_workers() -> int:
    """Of `-n auto`: one worker more than processors, as the one with the tests in real time mostly waits."""
    return min(os.cpu_count() or 1, MOST_PROCESSORS) + 1


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Group the tests; put those in real time first, which take the longest however many the processors."""
    items.sort(key=lambda item: item.get_closest_marker(REAL_TIME) is None)
    for item in items:
        is_real_time = item.get_closest_marker(REAL_TIME) is not None
        item.add_marker(pytest.mark.xdist_group(REAL_TIME if is_real_time else item.nodeid.partition("::")[0]))

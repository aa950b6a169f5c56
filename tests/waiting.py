"""Waiting for what another thread or process does."""

import time
from collections.abc import Callable

WITHIN_S = 60.0
"""On a busy machine, too."""


def until(holds: Callable[[], bool], what: str, within_s: float = WITHIN_S) -> None:
    """Wait for something that must come; its not coming is the failure."""
    end_s = time.monotonic() + within_s
    while not holds():
        assert time.monotonic() < end_s, f"{what} did not come within {within_s:g} s"
        time.sleep(0.01)

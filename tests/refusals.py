"""What a driver says when it refuses."""

import time
from collections.abc import Callable

import pytest

from drivers.boundary import DriverError


def refusal_of(kind: type[DriverError], act: Callable[[], object], *, names: str, within_s: float) -> str:
    """Return what the error says: of this kind, in time, in one line that begins with the device."""
    start_s = time.perf_counter()
    with pytest.raises(DriverError) as caught:
        act()
    assert time.perf_counter() - start_s < within_s, "in a bounded time"
    assert type(caught.value) is kind, caught.value
    text = str(caught.value)
    assert "\n" not in text
    assert text.startswith(names)
    assert " unit 1: " in text
    return text

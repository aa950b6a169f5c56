"""A driver taken up again after a fault. A busy machine may make an answer late: then it is asked for again."""

import time
from collections.abc import Callable
from typing import TypeVar

from drivers.boundary import Driver, NoReply, Reading

WITHIN_S = 60.0
T = TypeVar("T")


def opened(driver: Driver) -> float:
    """Open a driver; return the command that the device holds, Pa."""
    return _in_time(driver.open)


def taken_up(driver: Driver, command_pa: float) -> Reading:
    """Open a driver and command; return the reading."""

    def exchanged() -> Reading:
        driver.open()
        return driver.exchange(command_pa)

    return _in_time(exchanged)


def _in_time(act: Callable[[], T]) -> T:
    end_s = time.monotonic() + WITHIN_S
    while True:
        try:
            return act()
        except NoReply:
            if time.monotonic() > end_s:
                raise

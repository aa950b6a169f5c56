"""When a device samples: before it obeys the command of the same exchange, or after, on request.

What its readings alone tell is whether they are on its own clock; that takes no command. Which pressure comes with a
command, a change of the command by a few digits tells: the reply to it shows the pressure of before or already the new
one, and the reply after it shows the new one in any case.
"""

import time
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, Literal

from config.errors import CommandFailed

if TYPE_CHECKING:
    from drivers.boundary import Driver

SETTLE = 5
"""Exchanges before the change."""
WITHIN_S = 10.0
"""For which the pressure is awaited, however often the device answers: an I/P converter needs a second or two."""
SHOWN_SHARE = 0.5
"""Of the change: a pressure that shows so much of it is of after the command."""


@dataclass(frozen=True, slots=True)
class Shown:
    """When a change of the command showed: `sampling` as in table `[device]`, and after how many more replies."""

    sampling: Literal["before", "after"]
    replies: int


def when_shown(driver: "Driver", held_pa: float, nudge_pa: float) -> Shown:
    """Change the command by a little, watch the pressures, and put the command back.

    Args:
        driver: open; the device holds `held_pa`.
        held_pa: what it holds.
        nudge_pa: how much more it is commanded.

    Raises:
        CommandFailed: the device shows no pressure, or not the change; or the command could not be put back, after
            whatever went wrong before.
        DriverError: no reply.
    """
    from drivers.boundary import DriverError

    try:
        shown = _watch_nudge(driver, held_pa, nudge_pa)
    except (DriverError, CommandFailed) as error:
        if said := _put_back(driver, held_pa):
            raise CommandFailed(f"{error}; and {said}") from None
        raise
    except BaseException:
        _put_back(driver, held_pa)
        raise
    if said := _put_back(driver, held_pa):
        raise CommandFailed(said)
    return shown


def _watch_nudge(driver: "Driver", held_pa: float, nudge_pa: float) -> Shown:
    for _ in range(SETTLE):
        before_pa = driver.exchange(held_pa).pressure_pa
    if before_pa is None:
        raise CommandFailed("it shows no pressure: a change of the command cannot be seen")
    end_s = time.monotonic() + WITHIN_S
    for replies in count():
        shown_pa = driver.exchange(held_pa + nudge_pa).pressure_pa
        if shown_pa is not None and (shown_pa - before_pa) / nudge_pa > SHOWN_SHARE:
            return Shown("before" if replies else "after", replies)
        if time.monotonic() > end_s:
            break
    raise CommandFailed(f"its pressure does not show a change of {nudge_pa:g} Pa within {WITHIN_S:g} s")


def _put_back(driver: "Driver", held_pa: float) -> str:
    """Command what was held, on a connection of its own where the first is lost; return why that failed, or nothing."""
    from drivers.boundary import DriverError

    try:
        try:
            driver.write(held_pa)
        except DriverError:
            driver.close()
            driver.open()
            driver.write(held_pa)
    except DriverError as error:
        return f"the command could not be put back to {held_pa:g} Pa: {error}"
    return ""

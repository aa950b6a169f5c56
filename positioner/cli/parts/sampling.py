"""When a device samples: before it obeys the command of the same exchange, or after, on request.

What its readings alone tell is whether they are on its own clock; that takes no command. Which pressure comes with a
command, a change of the command by a few digits tells: the reply to it shows the pressure of before or already the new
one, and the reply after it shows the new one in any case.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from config.errors import CommandFailed

if TYPE_CHECKING:
    from drivers.boundary import Driver

SETTLE, REPLIES = 5, 200
"""Exchanges before the change, and the most for which the pressure is awaited."""
SHOWN = 0.5
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
        CommandFailed: the device shows no pressure, or not the change.
        DriverError: no reply.
    """
    try:
        for _ in range(SETTLE):
            before_pa = driver.exchange(held_pa).pressure_pa
        if before_pa is None:
            raise CommandFailed("it shows no pressure: a change of the command cannot be seen")
        for replies in range(REPLIES):
            shown_pa = driver.exchange(held_pa + nudge_pa).pressure_pa
            if shown_pa is not None and (shown_pa - before_pa) / nudge_pa > SHOWN:
                return Shown("before" if replies else "after", replies)
    finally:
        driver.write(held_pa)
    raise CommandFailed(f"its pressure does not show a change of {nudge_pa:g} Pa within {REPLIES} replies")

"""Where a file is dropped on a page.

The server keeps the routes by which files came in its caches, long after a page is gone. So the box knows what takes
its file weakly: else every page that was ever opened would stay in memory.

A file is taken when the browser has been told that it came: what takes it may draw this part of the page anew, and a
browser that is not told by then would break the request off, and call it failed.
"""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from weakref import WeakMethod

from nicegui import events, ui

from positioner.pages.parts.server import MOST_BYTES
from positioner.pages.parts.telling import tell_error

Taken = Callable[[events.UploadEventArguments], Awaitable[None]]
TOLD_WITHIN_S = 3.0
"""A browser that does not say so by then, or whose box is gone, loses no file either."""


def drop_box(label: str, name: str, taken: Taken, props: str = "") -> None:
    """Show a box for a file; `taken`, a method, is called with it as long as its object is there."""
    kept, told = WeakMethod(taken), asyncio.Event()

    async def took(event: events.UploadEventArguments) -> None:
        told.clear()
        with suppress(TimeoutError):
            await asyncio.wait_for(told.wait(), TOLD_WITHIN_S)
        take = kept()
        if take is not None:
            await take(event)

    box = ui.upload(label=label, on_upload=took, on_rejected=_refuse, max_file_size=MOST_BYTES, auto_upload=True)
    box.on("uploaded", told.set, args=[])
    box.classes("w-full").props(f'flat bordered data-testid="{name}" {props}')


def _refuse() -> None:
    tell_error(f"a file may have {MOST_BYTES >> 20} MiB at most")

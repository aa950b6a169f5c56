"""Where a file is dropped on a page.

The server keeps the routes by which files came in its caches, long after a page is gone. So the box knows what takes
its file weakly: else every page that was ever opened would stay in memory.
"""

from collections.abc import Awaitable, Callable
from weakref import WeakMethod

from nicegui import events, ui

from positioner.pages.parts.server import MOST_BYTES
from positioner.pages.parts.telling import tell_error

Taken = Callable[[events.UploadEventArguments], Awaitable[None]]


def drop_box(label: str, name: str, taken: Taken, props: str = "") -> None:
    """Show a box for a file; `taken`, a method, is called with it as long as its object is there."""
    kept = WeakMethod(taken)

    async def took(event: events.UploadEventArguments) -> None:
        take = kept()
        if take is not None:
            await take(event)

    box = ui.upload(label=label, on_upload=took, on_rejected=_refuse, max_file_size=MOST_BYTES, auto_upload=True)
    box.classes("w-full").props(f'flat bordered data-testid="{name}" {props}')


def _refuse() -> None:
    tell_error(f"a file may have {MOST_BYTES >> 20} MiB at most")

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

from webpage.messages import tell_error
from webpage.server import MOST_BYTES

Taken = Callable[[events.UploadEventArguments], Awaitable[None]]
TOLD_WITHIN_S = 3.0
"""A browser that does not say so by then, or whose box is gone, loses no file either."""


REJECTED = "(rejected) => emit(rejected[0].file.name, rejected[0].failedPropValidation)"
"""Of what the browser itself turned away: the file's name, and which of the box's properties it did not meet."""


def drop_box(label: str, name: str, taken: Taken, accept: str = "") -> None:
    """Show a box for a file; `taken`, a method, is called with it as long as its object is there.

    Args:
        label: what stands over it.
        name: of the box, for tests.
        taken: takes the file.
        accept: how a file's name must end; any, where nothing is said.
    """
    kept, told = WeakMethod(taken), asyncio.Event()

    async def took(event: events.UploadEventArguments) -> None:
        told.clear()
        with suppress(TimeoutError):
            await asyncio.wait_for(told.wait(), TOLD_WITHIN_S)
        take = kept()
        if take is not None:
            await take(event)

    def refuse(event: events.GenericEventArguments) -> None:
        file, unmet = event.args
        tell_error(refusal(file, unmet, accept))

    box = ui.upload(label=label, on_upload=took, max_file_size=MOST_BYTES, auto_upload=True)
    box.on("rejected", refuse, js_handler=REJECTED)
    box.on("uploaded", told.set, args=[])
    box.classes("w-full").props(f'flat bordered data-testid="{name}"' + (f' accept="{accept}"' if accept else ""))


def refusal(file: str, unmet: str, accept: str = "") -> str:
    """Return why a browser did not take a file.

    >>> refusal("rec.csv", "accept", ".toml")
    'rec.csv: a file whose name ends in .toml is wanted here'
    >>> refusal("rec.csv", "max-file-size")
    'rec.csv: a file may have 256 MiB at most'
    """
    if unmet == "accept":
        return f"{file}: a file whose name ends in {accept} is wanted here"
    return f"{file}: a file may have {MOST_BYTES >> 20} MiB at most"

"""The page of one tab of the workbench."""

from nicegui import ui

from positioner.pages.parts.server import Listening, serve
from positioner.pages.parts.theme import Theme

TITLE = "positioner workbench"


def serve_workbench(where: Listening, *, opens_browser: bool) -> None:
    """Serve the page until the process is told to end.

    Raises:
        InputError: the address cannot be had.
    """
    serve(TITLE, _build, where, opens_browser=opens_browser)


async def _build() -> None:
    theme = Theme()
    with ui.header():
        ui.label(TITLE)
        ui.space()
        theme.switch()
    await ui.context.client.connected()
    await theme.as_the_browser_prefers()

"""The page of one tab of the workbench."""

from collections.abc import Sequence
from pathlib import Path

from nicegui import app, ui

from webpage.messages import aside, errors_told, heading, look_at
from webpage.server import Listening, serve
from webpage.theme import Theme
from webpage.unit_choice import unit_choice
from workbench.page.compare_panel import ComparePanel
from workbench.page.desk import Desk, name_valve
from workbench.page.journal_panel import JournalPanel
from workbench.page.open_panel import OpenPanel, files_of
from workbench.page.recording_opening import Opened, open_file
from workbench.page.search_panel import SearchPanel

TITLE = "positioner workbench"
MOST_EMPTY_DESKS = 10
"""Desks that are kept though nobody sits at them: a page may be opened again."""


class Workbench:
    """The desks of all tabs.

    Args:
        files: recordings that are offered; of a single one the page begins with it.
        valve: the valve that the page begins with.
        only_here: whether this machine alone reaches it.
    """

    def __init__(self, files: Sequence[Path], valve: str | None, *, only_here: bool) -> None:
        self._only_here = only_here
        self._files = files
        self._valve = valve
        self._desks: dict[str, Desk] = {}

    def desk(self, tab: str) -> Desk:
        """Return the desk of a tab; a new one has on it what the command line named.

        Raises:
            InputError: that cannot be simulated.
        """
        if tab not in self._desks:
            desk = self._desks[tab] = Desk(may_write_effects=self._only_here)
            if self._valve is not None:
                desk.take_valve(name_valve(self._valve))
            if len(self._files) == 1:
                found = open_file(self._files[0], str(self._files[0]))
                if isinstance(found, Opened):
                    desk.take_recording(found)
                else:
                    desk.export = found
        return self._desks[tab]

    def clear(self) -> None:
        """Remove what was written for the desks."""
        for each in self._desks.values():
            each.clear()

    async def page(self) -> None:
        """Build the page of one tab."""
        theme = Theme()
        with ui.header().classes("items-center"):
            ui.label(TITLE).classes("text-weight-medium")
            ui.space()
            choices = ui.row().classes("items-center")
            theme.switch()
        await ui.context.client.connected()
        await theme.as_the_browser_prefers()
        tab = ui.context.client.tab_id
        assert tab is not None
        with errors_told():
            await aside(self.desk, tab)
        desk = self._desks[tab]
        self.came(desk)
        ui.context.client.on_delete(lambda: self.left(desk))
        shown = TabPage(desk, theme, self._files)
        with choices:
            unit_choice(desk.units, shown.changed)
            back = ui.button(icon="undo", on_click=shown.undo).tooltip("take back what was done last")
            back.props('flat round dense color=white aria-label="undo" data-testid="undo-all"')

    def came(self, desk: Desk) -> None:
        """Count a page that shows a desk."""
        desk.pages += 1

    def left(self, desk: Desk) -> None:
        """Stop what nobody waits for any more, and forget the desks that were left longest ago."""
        desk.pages -= 1
        if desk.pages:
            return
        desk.stop()
        left = [tab for tab, each in self._desks.items() if not each.pages]
        for tab in left[:-MOST_EMPTY_DESKS]:
            self._desks.pop(tab).clear()


class TabPage:
    """The panels of one tab."""

    def __init__(self, desk: Desk, theme: Theme, files: Sequence[Path]) -> None:
        self._desk = desk
        self._theme = theme
        with ui.column().classes("panel"):
            self._open = OpenPanel(desk, theme, files, self.changed)
            self._rest = ui.column().classes("w-full")
        self.changed()

    async def undo(self) -> None:
        """Take back what was done last."""
        with errors_told():
            if await aside(self._desk.undo):
                self.changed()

    def _retell(self) -> None:
        """Say anew what does the same on a command line."""
        self._journal.retell()

    def changed(self, at: str = "") -> None:
        """Show what goes with the recording and the valve on the desk; `at` is the heading that is looked at then."""
        self._theme.forget()
        self._open.refresh()
        self._rest.clear()
        if self._desk.live is None:
            with self._rest:
                ui.label("Begin with a recording and a valve, or with a blind case.").classes("quiet")
            return
        with self._rest:
            heading("Model against measurement", "comparison")
            ComparePanel(self._desk, self._theme, self._retell)
            SearchPanel(self._desk, self._theme, self.changed, self._retell)
            with ui.column().classes("w-full after-plots"):
                self._journal = JournalPanel(self._desk, self._theme, self.changed)
            if at:
                look_at(at)


def serve_workbench(recordings: Sequence[Path], valve: str | None, where: Listening, *, opens_browser: bool) -> None:
    """Serve the page until the process is told to end.

    Args:
        recordings: files that the page offers, or folders with some.
        valve: the valve file that it begins with, or a shipped one's name.
        where: it listens.
        opens_browser: at its address.

    Raises:
        InputError: a file is not there or is wrong, or the address cannot be had.
    """
    workbench = Workbench(files_of(recordings), valve, only_here=where.is_own)
    if valve is not None:
        name_valve(valve)
    app.on_shutdown(workbench.clear)
    serve(TITLE, workbench.page, where, opens_browser=opens_browser)

"""The page of one tab: all valves, or one in full; ten times a second what changes by the reading.

A browser that takes longer to show it gets the next when it has shown this one, so that what it shows is never of long
ago, however slow it is.
"""

import asyncio
import time
from collections.abc import Sequence
from contextlib import suppress
from math import inf

from nicegui import app, ui

from config.passwords import SignIn
from northbound.observer.watched_valves import Place, WatchedValve, watching
from northbound.operator_page.overview import Overview
from northbound.operator_page.signed_in import SignedIn
from northbound.operator_page.status_marks import STYLE, SignOfLife
from northbound.operator_page.valve_controls import Door
from northbound.operator_page.valve_panel import ValvePanel
from webpage.messages import aside
from webpage.server import Listening, serve
from webpage.theme import Theme
from webpage.unit_choice import unit_choice
from webpage.units import Units

TITLE = "positioner"
TICK_S = 0.1
REFRESH_EVERY_S = 0.5
BROWSER_S = 3.0
"""What the browser may take to show a reading, before it is told the next all the same: it was away, perhaps."""
ALL = "all valves"


def serve_valves(places: Sequence[Place], where: Listening, sign_in: SignIn | None, *, opens_browser: bool) -> None:
    """Serve the page of these valves until the process is told to end.

    Raises:
        InputError: the address cannot be had, or needs a password and has none.
    """
    with watching(places) as valves:

        async def build() -> None:
            await Tab(valves, sign_in).build()

        async def end() -> None:
            """Give the laws their command back: the process is gone right after this."""
            await asyncio.gather(*(aside(valve.end) for valve in valves))

        app.on_shutdown(end)
        serve(TITLE, build, where, opens_browser=opens_browser)


class Tab:
    """What one tab shows."""

    def __init__(self, valves: list[WatchedValve], sign_in: SignIn | None) -> None:
        self._valves = valves
        self._units = Units()
        self._signed = SignedIn()
        self._sign_in = sign_in
        self._overview: Overview | None = None
        self._panel: ValvePanel | None = None
        self._refreshed_s = -inf

    async def build(self) -> None:
        """Build it, and keep it up to date as long as the tab is there."""
        self._theme = Theme()
        ui.add_css(STYLE)
        names = [valve.place.name for valve in self._valves]
        several = len(names) > 1
        with ui.header().classes("items-center"):
            ui.label(TITLE).classes("text-subtitle1 title")
            self._chosen = ui.select([ALL, *names] if several else names, value=ALL if several else names[0])
            self._chosen.props('dense dark options-dense borderless aria-label="valve" data-testid="valve"')
            self._chosen.on_value_change(self._show)
            ui.space()
            unit_choice(self._units, self._redraw)
            self._door = Door(self._sign_in, self._signed)
            self._theme.switch()
        self._life = SignOfLife()
        with self._life.around:
            self._content = ui.element("div").classes("panel column")
        await ui.context.client.connected()
        await self._theme.as_the_browser_prefers()
        self._show()
        ui.timer(TICK_S, self._tick)

    def _redraw(self) -> None:
        if self._panel is not None:
            self._panel.redraw()

    def _choose(self, name: str) -> None:
        self._chosen.set_value(name)

    def _show(self) -> None:
        """Show what is chosen."""
        self._theme.forget()
        self._content.clear()
        self._overview = self._panel = None
        chosen = str(self._chosen.value)
        with self._content:
            if chosen == ALL:
                self._overview = Overview(self._valves, self._units, self._choose)
            else:
                (valve,) = (each for each in self._valves if each.place.name == chosen)
                self._panel = ValvePanel(self._theme, valve, self._units, self._signed)
        self._refreshed_s = -inf

    async def _tick(self) -> None:
        """Show what is now, and wait until the browser has done so."""
        now_s = time.monotonic()
        slow = now_s - self._refreshed_s >= REFRESH_EVERY_S - TICK_S / 2
        self._refreshed_s = now_s if slow else self._refreshed_s
        if self._overview is not None and slow:
            for valve in self._valves:
                self._overview.show(valve.view.at(now_s), valve.view.stroke_m)
        if self._panel is not None:
            picture = self._panel.valve.view.at(now_s)
            self._panel.tick(picture)
            if slow:
                self._panel.refresh(picture)
        if slow:
            self._door.show()
            self._life.give()
        with suppress(TimeoutError):
            await ui.run_javascript("0", timeout=BROWSER_S)

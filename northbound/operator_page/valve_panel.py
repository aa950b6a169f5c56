"""One valve in full. Every word comes from `valve_facts` and what that stands on; here it is only put in its place."""

import time
from collections.abc import Callable, Iterable

from nicegui import ui

from config.results.block import as_html
from northbound.observer.last_moves import LastMoves, last_moves
from northbound.observer.valve_commands import Confirmation
from northbound.observer.valve_events import WhatHappened, what_happened
from northbound.observer.valve_view import ValvePicture
from northbound.observer.watched_valves import WatchedValve
from northbound.operator_page import valve_facts
from northbound.operator_page.alarm_card import AlarmCard
from northbound.operator_page.friction_plot import FrictionPlot
from northbound.operator_page.recorded_plot import RecordedPlot
from northbound.operator_page.signed_in import SignedIn
from northbound.operator_page.status_marks import grey, mark_fault, mark_ne107
from northbound.operator_page.test_card import TestCard
from northbound.operator_page.trend_plot import WINDOWS_S, TrendPlot
from northbound.operator_page.valve_controls import Controls
from northbound.operator_page.valve_facts import Fact
from webpage.messages import aside, heading
from webpage.theme import Theme
from webpage.units import Units

MOVES_S = 120.0
"""Of which the response figures are worked out."""
SHOWN_EVENTS = 12  # what a card has room for
HISTORY_EVERY_S = 1.0
LABELS = ("reference", "position", "pressure", "command")


class FactsCard:
    """A card of lines, whose texts change in place."""

    def __init__(self, title: str, name: str) -> None:
        with ui.card().classes("full-width").props(f'data-testid="{name}"') as self.card:
            heading(title)
            self._list = ui.element("dl").classes("facts")
        self._labels: list[str] = []
        self._texts: list[ui.label] = []

    def show(self, lines: Iterable[Fact]) -> None:
        """Show these lines; where they are of the same as before, their texts alone change."""
        lines = list(lines)
        labels = [line.label for line in lines]
        if labels != self._labels:
            self._labels, self._texts = labels, []
            self._list.clear()
            with self._list:
                for line in lines:
                    ui.html(line.label, tag="dt", sanitize=False).tooltip(line.help or line.label)
                    with ui.element("dd"):
                        self._texts.append(ui.label().classes("number"))
        for label, line in zip(self._texts, lines, strict=True):
            label.set_text(line.text)


class ValvePanel:
    """All of one valve, in one tab."""

    def __init__(self, theme: Theme, valve: WatchedValve, units: Units, signed: SignedIn) -> None:
        self.valve = valve
        self._units = units
        self._happened: WhatHappened | None = None
        self._stale = ui.label().classes("alarm").props('role="alert" data-testid="stale"')
        with ui.element("div").classes("full-width") as self._body:
            self._body.props('data-testid="live-values"')
            self._tiles()
            with ui.element("div").classes("together"):
                with ui.element("div").classes("wide column"):
                    self._trend(theme)
                    self._moves(theme)
                    self._tests = TestCard(valve.place, valve.tests, signed, self._do)
                with ui.element("div").classes("side column before-plots"):
                    self._controls = Controls(valve, signed, units)
                    self._alarms = AlarmCard(valve.commands, signed, self._controls.do)
                    self._status = FactsCard("Status", "status")
            with ui.element("div").classes("cards"):
                self._estimates = FactsCard("Estimates, with 95 % intervals", "estimates")
                self._wear = FactsCard("Friction and wear", "wear")
                with self._wear.card:
                    self._friction = FrictionPlot(theme, valve.view, units)
                self._cycle = FactsCard("The daemon's cycle", "cycle")
                self._history_list()
        ui.timer(HISTORY_EVERY_S, self._read_history)

    def tick(self, picture: ValvePicture) -> None:
        """Show what changes by the reading."""
        self._stale.set_text(picture.freshness.daemon and f"Not live: {picture.freshness.daemon}")
        self._stale.set_visibility(not picture.freshness.live)
        grey(self._body, not picture.freshness.live)
        self._waiting.set_text(valve_facts.waiting(picture, self.valve.view.stroke_m, self._units))
        for name, text in valve_facts.figures(picture, self.valve.view.stroke_m, self._units).items():
            self._figures[name].set_text(text)
        for name in ("position", "pressure"):
            grey(self._figures[name], not picture.freshness.measured_live)
        self._condition(picture)
        self.trend.extend()

    def refresh(self, picture: ValvePicture) -> None:
        """Show what a person reads slowly."""
        self._status.show(valve_facts.status(picture))
        self._wear.show(valve_facts.wear(picture, self._units))
        self._friction.refresh()
        self._cycle.show(valve_facts.cycle(picture))
        self._estimates.show(valve_facts.estimates(picture, self.valve.view.stroke_m, self._units))
        self._controls.show(picture)
        self._alarms.show(picture)
        self._tests.show(picture)

    async def _do(self, command: Callable[..., Confirmation]) -> None:
        await self._controls.do(command)

    def redraw(self) -> None:
        """Draw it in other units."""
        self._controls.redraw()
        self.trend.redraw()
        self._recorded.redraw()

    def _tiles(self) -> None:
        self._figures: dict[str, ui.label] = {}
        with ui.element("div").classes("tiles"):
            for name in LABELS:
                with ui.element("div").classes("tile"):
                    ui.label(name).classes("quiet")
                    self._figures[name] = ui.label().classes("figure number").props(f'data-testid="figure-{name}"')
                    if name == "reference":
                        self._waiting = ui.label().props('data-testid="waiting"')
            with ui.element("div").classes("tile"):
                ui.label("mode, state").classes("quiet")
                self._mode = ui.label().classes("figure").props('data-testid="mode"')
            with ui.element("div").classes("tile"):
                ui.label("NE 107").classes("quiet")
                self._ne107 = ui.label().classes("figure").props('data-testid="ne107"')
                self._causes = ui.label().classes("quiet").props('data-testid="causes"')
            with ui.element("div").classes("tile"):
                ui.label("fault").classes("quiet")
                self._fault = ui.label().classes("figure").props('data-testid="fault"')

    def _condition(self, picture: ValvePicture) -> None:
        letter, words, causes = valve_facts.condition(picture)
        self._mode.set_text(f"{picture.text('mode')}, {picture.text('state')}")
        self._ne107.set_text(words)
        mark_ne107(self._ne107, letter)
        self._causes.set_text("; ".join(causes))
        self._fault.set_text(picture.text("fault"))
        mark_fault(self._fault, valve_facts.is_faulty(picture))

    def _trend(self, theme: Theme) -> None:
        with ui.card().classes("full-width"):
            with ui.row().classes("items-center full-width justify-between"):
                heading("Trend")
                window = ui.toggle(list(WINDOWS_S), value="1 min")
            window.props('no-caps dense unelevated toggle-color=primary data-testid="window"')
            trend = self.trend = TrendPlot(theme, self.valve.view, self._units)
            window.on_value_change(lambda change: trend.show(change.value))

    def _moves(self, theme: Theme) -> None:
        with ui.card().classes("full-width").props('data-testid="moves"'):
            with ui.row().classes("items-center full-width justify-between"):
                heading("Last moves, and their response")
                ui.button("Show", on_click=self._work_out).props('no-caps outline dense data-testid="work-out"')
            self._recorded = RecordedPlot(theme, self._units)
            self._moves_said = ui.html("", sanitize=False).classes("scrolling full-width")

    async def _work_out(self) -> None:
        view, folder = self.valve.view, self.valve.place.recordings
        settings = self.valve.place.settings
        travel = None if settings is None else settings.valve.travel
        moves = await aside(last_moves, view, time.monotonic(), MOVES_S, folder, time.time(), travel)
        self._moves_said.set_content(_describe_moves(moves))
        if moves is not None:
            self._recorded.show(moves.recording, self.valve.view.stroke_m)

    def _history_list(self) -> None:
        with ui.card().classes("full-width").props('data-testid="history"'):
            heading("What has happened")
            self._history_source = ui.label().classes("quiet")
            self._history_rows = ui.element("ul").classes("said")

    async def _read_history(self) -> None:
        """Show what has happened to the valve, where that is other than before."""
        place, picture, off_s = self.valve.place, self.valve.picture(), time.time() - time.monotonic()
        happened = await aside(
            what_happened, place.history, place.name, picture.served, picture.events, round(off_s), SHOWN_EVENTS
        )
        if happened == self._happened or self._history_rows.is_deleted:
            return
        self._happened = happened
        self._history_source.set_text(happened.source)
        self._history_rows.clear()
        with self._history_rows:
            for line in valve_facts.list_events(happened.lines):
                with ui.element("li"):
                    ui.label(line)


def _describe_moves(moves: LastMoves | None) -> str:
    if moves is None:
        return "nothing was measured yet"
    return as_html("", [moves.source, *moves.response.blocks()])

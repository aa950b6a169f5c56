"""Measured and simulated over time, forces over velocity and position, the sentences of `compare`, and the sliders."""

import asyncio

import numpy as np
from nicegui import events, ui

from positioner.pages.parts.figure_view import Figure, FigureView
from positioner.pages.parts.telling import aside, errors_told, sentences
from positioner.pages.parts.theme import Theme
from positioner.pages.workbench_page.desk import Desk
from positioner.pages.workbench_page.force_figures import force_figure
from positioner.pages.workbench_page.live_model import LiveModel
from positioner.pages.workbench_page.sliders import Sliders
from positioner.pages.workbench_page.time_figure import LINES, MARKS, MOVING, TimeFigure, Window, window_of
from workbench.compare.comparison import Comparison
from workbench.report.comparison_report import headline
from workbench.report.units import length, of_stroke

AROUND_S = 2.0
"""Before and after what is jumped to."""
MOVED = ("model", "error", "model's pressure")
"""Lines that a slider moves,"""
MOVED_LINES = [LINES.index(name) for name in MOVED]
"""and which they are."""
QUIET_S = 0.25
"""Without a move or another window: then what takes longer is drawn too."""
TIME_PX, FORCE_PX = 520, 300


class ComparePanel:
    """The panel of the valve and the recording that are on the desk."""

    def __init__(self, desk: Desk, theme: Theme) -> None:
        assert desk.live is not None
        assert desk.compared is not None
        self._desk = desk
        self._theme = theme
        self._live: LiveModel = desk.live
        self._asked = 0
        """How often something was asked for that takes longer than a curve."""
        self._figure = TimeFigure(self._live.record)
        self._forces = self._live.forces()
        self._begin_s = float(self._live.record.time_s[0])
        self._figure.slips = desk.compared.slips
        self._show_curve()
        for name, position_m in desk.variants.items():
            self._figure.show(name, position_m)
        with ui.element("section").classes("together").props('data-testid="compared"'):
            with ui.column().classes("wide"):
                self._figures = ui.row().classes("w-full items-end").style("gap: 24px")
                with self._figures:
                    self._error = _figure_of_merit("error, rms", "error")
                    self._floor = _figure_of_merit("floor", "floor")
                    self._fit = _figure_of_merit("fit", "fit")
                    self._jumps = ui.row().classes("items-center")
                self._time = FigureView(theme, self._drawn, TIME_PX, "position, error and pressure over time")
                self._time.plot.on("plotly_relayout", self._looked_at)
                self._time.plot.on("plotly_click", self._clicked)
                with ui.element("div").classes("together"):
                    self._clouds = [self._cloud(over) for over in ("velocity", "position")]
            with ui.column().classes("side"):
                self._said = ui.column().classes("w-full")
                Sliders(self._live, desk.fitted, self._moved, self._settled)
        self._tell(desk.compared)

    def _drawn(self) -> Figure:
        return self._figure.figure(self._theme.ink)

    def _cloud(self, over: str) -> FigureView:
        def draw() -> Figure:
            return force_figure(over, self._forces, self._begin_s, self._figure.window, self._theme.ink)

        with ui.element("div").style("flex: 1 1 300px; min-width: min(300px, 100%)"):
            view = FigureView(self._theme, draw, FORCE_PX, f"friction over {over}")
        view.plot.on("plotly_selected", self._selected, args=["points"])
        return view

    def _show_curve(self) -> float:
        curve = self._live.curve()
        self._figure.show("model", curve.simulated_m)
        self._figure.show_pressure(curve.pressure_pa)
        return curve.rms_m

    def _moved(self) -> None:
        """Draw the new curve; nothing else is worked out while a slider moves."""
        rms_m = self._show_curve()
        self._time.restyle(self._figure.data(MOVED, MOVING), MOVED_LINES)
        self._error.set_text(f"{length(rms_m).text} mm")

    async def _settled(self) -> None:
        """Draw the curve in full; when the hand has come to rest, work out all that hangs on the parameters."""
        self._time.restyle(self._figure.data(MOVED), MOVED_LINES)
        if not await self._is_quiet():
            return
        mine = self._asked
        with errors_told():
            compared = await aside(self._desk.compare)
            self._forces = await aside(self._live.forces)
            if mine == self._asked:
                self._figure.slips = compared.slips
                self._marked()
                self._tell(compared)
                self._redraw_clouds()

    async def _is_quiet(self) -> bool:
        """Wait a moment; whether nothing else was asked in it."""
        self._asked += 1
        mine = self._asked
        await asyncio.sleep(QUIET_S)
        return mine == self._asked

    def _redraw_clouds(self) -> None:
        for each in self._clouds:
            each.redraw()

    def _tell(self, compared: Comparison) -> None:
        self._error.set_text(f"{length(compared.rms_m).text} mm")
        self._floor.set_text("unknown" if compared.floor_m is None else f"{length(compared.floor_m).text} mm")
        self._fit.set_text(f"{compared.fit_percent:.1f} %")
        self._said.clear()
        with self._said:
            kind, first = headline(compared)
            ui.label(first).classes("text-weight-medium").props(f'data-testid="verdict" data-kind="{kind}"')
            sentences(compared.sentences, "sentences")
            stroke_m = self._live.valve.valve.stroke_m
            ui.label(f"error: {of_stroke(compared.rms_m, stroke_m)}").classes("quiet")
        self._jumps.clear()
        with self._jumps:
            self._jump("missed", compared.slips.missed_s)
            self._jump("spurious", compared.slips.spurious_s)
            self._jump("largest error", (_largest_s(compared),), counted=False)
            ui.label(f"{len(compared.slips.matched)} slips matched").classes("quiet")

    def _jump(self, what: str, times_s: tuple[float, ...], *, counted: bool = True) -> None:
        """Show a button that goes from one of these times to the next."""
        at = 0

        def go() -> None:
            nonlocal at
            self._look(Window(times_s[at] - AROUND_S, times_s[at] + AROUND_S))
            at = (at + 1) % len(times_s)

        label = f"{len(times_s)} {what}" if counted else what
        button = ui.button(label, icon="my_location", on_click=go).props("flat dense no-caps")
        button.set_enabled(bool(times_s))

    def _marked(self) -> None:
        shown = self._figure.marks()
        self._time.restyle(
            {**shown, "showlegend": [bool(x) for x in shown["x"]]}, [len(LINES) + i for i in range(len(MARKS))]
        )

    def _look(self, window: Window) -> None:
        self._time.relayout({"xaxis.range": [window.begin_s, window.end_s]})

    async def _looked_at(self, event: events.GenericEventArguments) -> None:
        window = window_of(event.args, self._figure.whole)
        if window is None:
            return
        self._figure.window = window
        self._time.restyle(self._figure.data(), list(range(len(LINES))))
        if await self._is_quiet():
            self._redraw_clouds()

    def _clicked(self, event: events.GenericEventArguments) -> None:
        """Go closer to a slip that is clicked."""
        marks = [each for each in event.args.get("points", ()) if each.get("curveNumber", 0) >= len(LINES)]
        if marks:
            self._look(Window(marks[0]["x"] - AROUND_S, marks[0]["x"] + AROUND_S))

    def _selected(self, event: events.GenericEventArguments) -> None:
        """Mark in the plot over time what is selected in one of forces."""
        points = (event.args or {}).get("points") or ()
        self._figure.chosen_s = tuple(float(each["customdata"]) for each in points if "customdata" in each)
        self._marked()


def _figure_of_merit(what: str, name: str) -> ui.label:
    with ui.column().style("gap: 0"):
        ui.label(what).classes("quiet")
        return ui.label().classes("figure number").props(f'data-testid="{name}"')


def _largest_s(compared: Comparison) -> float:
    row = int(np.nanargmax(np.abs(compared.residual_m)))
    return float(compared.time_s[row] - compared.time_s[0])

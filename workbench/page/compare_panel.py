"""Measured and simulated over time, forces over velocity and position, the sentences of `compare`, and the sliders."""

import asyncio
from collections.abc import Callable

from nicegui import background_tasks, events, ui

from webpage.figure_view import Figure, FigureView
from webpage.live_text import LiveText
from webpage.messages import aside, errors_told
from webpage.theme import Theme
from workbench.compare.comparison import Comparison
from workbench.compare.comparison_sentences import Stretch
from workbench.compare.measures import fit_in_words
from workbench.page.desk import SAVED, Desk
from workbench.page.explained_words import word
from workbench.page.findings_panel import FindingsPanel
from workbench.page.force_figures import Seen, force_figure
from workbench.page.live_model import LiveModel
from workbench.page.sliders import Sliders
from workbench.page.time_figure import LINES, MARKS, MOVING, TimeFigure, around, window_of

MOVED = ("model", "error", "model's pressure")
"""Lines that a slider moves,"""
MOVED_LINES = [LINES.index(name) for name in MOVED]
"""and which they are."""
QUIET_S = 0.25
"""Without a move or another window: then what takes longer is drawn too."""
POINT = "event => emit([event.points[0].curveNumber, event.points[0].x, event.points[0].text])"
TIMES = "event => emit((event?.points ?? []).map(point => point.customdata))"
"""Of what is clicked, line, time and text; of what is selected, the times alone:
every point of the event carries its whole line along."""
TIME_PX, FORCE_PX = 520, 300


class ComparePanel:
    """The panel of the valve and the recording that are on the desk; `settled` is called once a slider has rested."""

    def __init__(self, desk: Desk, theme: Theme, settled: Callable[[], None]) -> None:
        assert desk.live is not None
        assert desk.compared is not None
        self._desk = desk
        self._theme = theme
        self._when_settled = settled
        self._live: LiveModel = desk.live
        self._to_draw = self._drawing = False
        self._asked = 0
        """How often something was asked for that takes longer than a curve."""
        stroke_m = self._live.valve.valve.stroke_m
        self._unit = desk.units.position_unit(stroke_m)
        self._figure = TimeFigure(self._live.record, stroke_m, desk.units)
        self._forces = self._live.forces()
        self._begin_s = float(self._live.record.time_s[0])
        self._figure.slips = desk.compared.slips
        self._show_curve()
        for name, position_m in desk.variants.items():
            self._figure.show(name, position_m)
        self._figures = ui.row().classes("w-full items-end").style("gap: 24px")
        with self._figures:
            self._error = _figure_of_merit("error, rms", "error", "error")
            self._floor = _figure_of_merit("floor", "floor")
            self._fit = _figure_of_merit("fit", "fit")
            jumps = ui.row().classes("items-center")
        with ui.element("section").classes("together compared").props('data-testid="compared"'):
            with ui.column().classes("wide plots"):
                self._time = FigureView(theme, self._figure.figure, TIME_PX, "position, error and pressure over time")
                self._time.plot.on("plotly_relayout", self._handle_window)
                self._time.plot.on("plotly_click", self._handle_click, js_handler=POINT)
                with ui.element("div").classes("together"):
                    self._clouds = [self._cloud(over) for over in ("velocity", "position")]
                for one, other in (self._clouds, reversed(self._clouds)):
                    one.plot.on(
                        "plotly_selected",
                        lambda event, other=other: self._handle_selection(event, other),
                        js_handler=TIMES,
                    )
            with ui.column().classes("side"):
                self._findings = FindingsPanel(self._go_to, stroke_m, desk.units)
                self._findings.jumps.move(jumps)
                ui.button("Keep this curve to compare with", icon="bookmark", on_click=self._keep).props(
                    'outline no-caps dense data-testid="keep"'
                )
                Sliders(self._live, desk.fitted, self._draw_newest, self._draw_in_full, desk.units)
        self._tell(desk.compared)

    def _cloud(self, over: str) -> FigureView:
        def draw() -> Figure:
            seen = Seen(self._begin_s, self._figure.window, self._figure.chosen_s)
            return force_figure(over, self._forces, seen, self._unit)

        with ui.element("div").style("flex: 1 1 300px; min-width: min(300px, 100%)"):
            return FigureView(self._theme, draw, FORCE_PX, f"friction over {over}")

    def _show_curve(self) -> float:
        curve = self._live.curve()
        self._figure.show("model", curve.simulated_m)
        self._figure.show_pressure(curve.pressure_pa)
        return curve.rms_m

    def _keep(self) -> None:
        with errors_told():
            self._desk.keep_variant()
            self._figure.show(SAVED, self._desk.variants[SAVED])
            self._time.redraw()

    def _draw_newest(self) -> None:
        """Draw the new curve, unless one is being drawn: then the newest when that stands, and none between."""
        self._to_draw = True
        if not self._drawing:
            background_tasks.create(self._draw_moves(), name="moves")

    async def _draw_moves(self) -> None:
        """Draw what is to be drawn; nothing else is worked out while a slider moves."""
        self._drawing = True
        try:
            while self._to_draw and not self._time.plot.is_deleted:
                self._to_draw = False
                rms_m = self._show_curve()
                self._error.show(self._unit.fine(rms_m))
                await self._time.move(self._figure.data(MOVED, MOVING), MOVED_LINES)
        except TimeoutError:
            pass  # the browser is away; what it shows when it is back, `_draw_in_full` or the next move draws
        finally:
            self._drawing = False

    async def _draw_in_full(self) -> None:
        """Draw the curve in full; when the hand has come to rest, work out all that hangs on the parameters."""
        self._time.restyle(self._figure.data(MOVED), MOVED_LINES)
        if not await self._is_quiet():
            return
        mine = self._asked
        with errors_told():
            compared = await aside(self._desk.compare)
            self._forces = await aside(self._live.forces)
            if self._is_last(mine):
                self._figure.slips = compared.slips
                self._draw_marks()
                self._tell(compared)
                self._redraw_clouds()
                self._when_settled()

    async def _is_quiet(self) -> bool:
        """Wait a moment; whether nothing else was asked in it."""
        self._asked += 1
        mine = self._asked
        await asyncio.sleep(QUIET_S)
        return self._is_last(mine)

    def _is_last(self, asked: int) -> bool:
        """Whether nothing was asked since, and this panel is still shown."""
        return asked == self._asked and not self._time.plot.is_deleted

    def _redraw_clouds(self) -> None:
        for each in self._clouds:
            each.redraw()

    def _tell(self, compared: Comparison) -> None:
        self._error.show(self._unit.fine(compared.rms_m))
        self._floor.show("unknown" if compared.floor_m is None else self._unit.fine(compared.floor_m))
        self._fit.show(fit_in_words(compared.fit_percent))
        self._findings.show(compared)

    def _draw_marks(self) -> None:
        shown = self._figure.marks()
        self._time.restyle(
            {**shown, "showlegend": [bool(x) for x in shown["x"]]}, [len(LINES) + i for i in range(len(MARKS))]
        )

    def _go_to(self, stretch: Stretch | None) -> None:
        """Look at a stretch with some time around it; None: at all."""
        self._figure.stretch = stretch
        window = self._figure.whole if stretch is None else around(stretch)
        self._figure.window = window
        self._time.relayout({"xaxis.range": [window.begin_s, window.end_s], "shapes": self._figure.shades()})

    async def _handle_window(self, event: events.GenericEventArguments) -> None:
        window = window_of(event.args, self._figure.whole)
        if window is None:
            return
        self._figure.window = window
        self._time.restyle(self._figure.data(), list(range(len(LINES))))
        if await self._is_quiet():
            self._redraw_clouds()

    def _handle_click(self, event: events.GenericEventArguments) -> None:
        """Go closer to a slip that is clicked, and say what the model makes of it."""
        line, at_s, said = event.args
        if line >= len(LINES):
            self._findings.tell(str(said or ""))
            self._go_to(Stretch(at_s, at_s))

    def _handle_selection(self, event: events.GenericEventArguments, other: FigureView) -> None:
        """Mark in the plot over time, and in the other of forces, what is selected in one of forces."""
        self._figure.chosen_s = tuple(map(float, event.args))
        self._draw_marks()
        other.redraw()


def _figure_of_merit(what: str, name: str, meaning: str = "") -> LiveText:
    with ui.column().style("gap: 0"):
        word(what, meaning)
        return LiveText().classes("figure number").props(f'data-testid="{name}"')

"""The last minutes as they were recorded, to zoom into: what is shown is thinned to the screen, what is zoomed is not.

The browser has the least and the greatest of each step of what it shows; zoomed in, the server sends that stretch anew,
down to every sample that the daemon took.
"""

import math

import numpy as np
from nicegui import events, ui

from config.recording import Column, Recording
from northbound.observer.trends import thin_columns
from northbound.operator_page.echart_options import Options, axis_title, chart_options, line, quiet
from webpage.theme import Theme
from webpage.units import Unit, Units

MOST_RECORDED_STEPS = 1500
"""Of what is shown; two rows a step at most."""
ZOOM_EVERY_S = 0.2
COLUMNS = ("reference_m", "position_m")


class RecordedPlot:
    """Position and reference of a recording in one tab; empty until there is one."""

    def __init__(self, theme: Theme, units: Units) -> None:
        self._theme = theme
        self._units = units
        self._columns: dict[str, Column] = {}
        self._stroke_m, self._turns = math.nan, False
        self._unit = Unit("", 1.0, 0)
        self._chart = ui.echart({}).classes("full-width").style("height: 240px")
        self._chart.props('data-testid="recorded" role="img" aria-label="the last minutes as recorded"')
        self._chart.on("chart:datazoom", self._handle_zoom, args=["start", "end", "batch"], throttle=ZOOM_EVERY_S)
        self._chart.set_visibility(False)
        theme.listen(self.redraw)

    def show(self, recording: Recording, stroke_m: float) -> None:
        """Show a recording, all of it."""
        nothing = np.full(len(recording), math.nan)
        self._columns = {"time_s": recording.time_s} | {name: recording.columns.get(name, nothing) for name in COLUMNS}
        self._stroke_m, self._turns = stroke_m, recording.kind.turns
        self._chart.set_visibility(True)
        self.redraw()

    def redraw(self) -> None:
        """Draw it in the colours and the units that are chosen now, if there is anything to draw."""
        if self._chart.is_deleted or not self._columns:
            return
        self._unit = self._units.position_unit(self._stroke_m, turns=self._turns)
        self._chart.options.clear()
        self._chart.options.update(self._whole())
        self._chart.update()

    def _handle_zoom(self, event: events.GenericEventArguments) -> None:
        told = (event.args.get("batch") or [event.args])[0]
        begin, end = float(told["start"]) / 100, float(told["end"]) / 100
        time_s = self._columns["time_s"]
        span_s = float(time_s[-1] - time_s[0])
        margin = end - begin
        rows = self._rows(time_s[0] + (begin - margin) * span_s, time_s[0] + (end + margin) * span_s)
        self._chart.run_chart_method("setOption", {"dataset": {"source": rows, "sourceHeader": False}})

    def _rows(self, begin_s: float, end_s: float) -> list[list[float]]:
        """Return what lies between two times, the end of the recording at 0 s."""
        time_s = self._columns["time_s"]
        inside = (time_s >= begin_s) & (time_s <= end_s)
        part = {name: column[inside] for name, column in self._columns.items()}
        if not len(part["time_s"]):
            return []
        step_s = (part["time_s"][-1] - part["time_s"][0]) / MOST_RECORDED_STEPS
        if len(part["time_s"]) > 2 * MOST_RECORDED_STEPS:
            part = thin_columns(part, step_s)
        lines = [np.round(self._unit.per_si * part[name], 4) for name in COLUMNS]
        rows: list[list[float]] = np.column_stack([np.round(part["time_s"] - time_s[-1], 5), *lines]).tolist()
        return rows

    def _whole(self) -> Options:
        ink, time_s = self._theme.ink, self._columns["time_s"]
        ends = {"axisLabel": {"color": ink.quiet, "showMinLabel": False}, "axisLine": {"onZero": False}}
        zoom = {"xAxisIndex": 0, "filterMode": "none"}
        drawn = (("reference", ink.model, "dashed"), ("position", ink.measured, "solid"))
        return chart_options(
            ink,
            grid={"left": 52, "right": 12, "top": 52, "bottom": 64},
            dataset={"source": self._rows(time_s[0], time_s[-1]), "sourceHeader": False},
            xAxis=quiet(ink, type="value", min=float(time_s[0] - time_s[-1]), max=0, name="s", **ends),
            yAxis=quiet(ink, scale=True, **axis_title(ink, f"position, {self._unit.name}"), **ends),
            dataZoom=[{"type": "inside", **zoom}, {"type": "slider", "height": 20, "bottom": 8, **zoom}],
            series=[
                line(colour, dash, name=name, encode={"x": 0, "y": number})
                for number, (name, colour, dash) in enumerate(drawn, start=1)
            ],
        )

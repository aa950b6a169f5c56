"""Reference, position and pressure as they come, with the states S0 to S3 as bands behind them.

Ten times a second the browser is sent what the window shows: every reading of a short one; of a longer one the least
and the greatest position of each step of time, so that no extreme is lost. Drawn on a canvas (ECharts).
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from nicegui import ui

from config.codes import State
from config.recording import Column
from northbound.observer.trends import WAITING, bands, thin_columns
from northbound.observer.valve_view import ValveView
from northbound.operator_page.echart_options import Options, axis_title, chart_options, line
from webpage.theme import Theme
from webpage.units import Unit, Units

WINDOWS_S = {"30 s": 30.0, "1 min": 60.0, "10 min": 600.0}
MOST_STEPS = 400
"""Of a window; two rows a step at most."""
LEAST_SPANS = (5e-2, 1e4)
"""Of the axes: in p.u., and in Pa, so that a stem at rest is a straight line and not its sensor's noise."""
ROOM = 0.08
"""Of an axis, above and below what is drawn."""
BANDS = {
    State.S0_START: "rgba(128,136,150,0.06)",
    State.S1_UP: "rgba(0,114,178,0.18)",
    State.S2_DOWN: "rgba(230,159,0,0.22)",
    State.S3_IDENTIFY: "rgba(204,121,167,0.28)",
}
"""Told apart by the colour-blind (Okabe and Ito), and by name."""
SHORTEST_NAMED = 0.04
"""A band that takes less of the window has no room for its name."""


@dataclass(frozen=True, slots=True)
class Line:
    """A line: the column it draws, its panel (0 position, 1 pressure), its ink, and how it is drawn."""

    column: str
    panel: int
    ink: str
    dash: str = "solid"

    @property
    def measured(self) -> bool:
        """Whether it is a measurement; what is asked for is held from reading to reading."""
        return self.dash == "solid"


LINES = {
    "reference": Line("reference_m", 0, "model", "dashed"),
    "position": Line("position_m", 0, "measured"),
    "command": Line("command_pa", 1, "better", "dashed"),
    "pressure": Line("pressure_pa", 1, "measured"),
    "waiting reference": Line(WAITING, 0, "model", "dotted"),
}


class TrendPlot:
    """The trend of one valve in one tab."""

    def __init__(self, theme: Theme, view: ValveView, units: Units) -> None:
        self._theme = theme
        self._view = view
        self._units = units
        self._window_s = WINDOWS_S["1 min"]
        self._is_drawn = False
        self._chart = ui.echart(self._whole()).classes("full-width").style("height: 440px")
        self._chart.props('data-testid="trend" role="img" aria-label="trend of reference, position and pressure"')
        # The first of them: from then on it may be changed.
        self._chart.on("chart:rendered", self._begin, args=[], throttle=1e9, trailing_events=False)
        theme.listen(self.redraw)

    def show(self, window: str) -> None:
        """Show another window."""
        self._window_s = WINDOWS_S[window]
        self.extend()

    def redraw(self) -> None:
        """Draw it anew, in other colours or units."""
        if self._is_drawn:
            self._chart.run_chart_method("setOption", self._whole())

    def extend(self) -> None:
        """Draw what has been read since."""
        if self._is_drawn:
            self._chart.run_chart_method("setOption", self._changing(), {"lazyUpdate": True})

    def _begin(self) -> None:
        self._is_drawn = True

    def _changing(self) -> Options:
        """Return what changes by the reading."""
        now_s = time.monotonic()
        rows = thin_columns(self._view.trend(now_s - self._window_s), self._window_s / MOST_STEPS)
        wall_ms = 1e3 * (time.time() - now_s)
        begin_ms, end_ms = wall_ms + 1e3 * (now_s - self._window_s), wall_ms + 1e3 * now_s
        lines = self._lines(rows)
        spans = (LEAST_SPANS[0] * self._position(self._view.stroke_m), LEAST_SPANS[1] * self._units.pressure.per_si)
        ranges = [
            _range(np.concatenate([lines[name] for name, each in LINES.items() if each.panel == panel]), least)
            for panel, least in enumerate(spans)
        ]
        source = np.column_stack(
            [np.round(wall_ms + 1e3 * rows["time_s"]), *(np.round(each, 4) for each in lines.values())]
        )
        areas = self._areas(rows, wall_ms)
        return {
            "dataset": {"source": source.tolist(), "sourceHeader": False},
            "xAxis": [{"min": round(begin_ms), "max": round(end_ms)}] * 2,
            "yAxis": [{"min": low, "max": high} for low, high in ranges],
            "series": [
                {"name": name, "markArea": {"data": areas if each.measured else []}} for name, each in LINES.items()
            ],
        }

    def _areas(self, rows: Mapping[str, Column], wall_ms: float) -> list[list[Options]]:
        named_ms = 1e3 * SHORTEST_NAMED * self._window_s
        areas: list[list[Options]] = []
        for band in bands(rows["time_s"], rows["state"]):
            begin, end = round(wall_ms + 1e3 * band.begin_s), round(wall_ms + 1e3 * band.end_s)
            name = band.state.text.partition(" ")[0] if end - begin > named_ms else ""
            areas.append([{"xAxis": begin, "name": name, "itemStyle": {"color": BANDS[band.state]}}, {"xAxis": end}])
        return areas

    def _lines(self, rows: Mapping[str, Column]) -> dict[str, Column]:
        """Return what is drawn, by name, in the units chosen."""
        per_si = (self._position(1.0), self._units.pressure.per_si)
        return {name: per_si[each.panel] * rows[each.column] for name, each in LINES.items()}

    def _position(self, position_m: Any) -> Any:
        return self._position_unit().per_si * position_m

    def _position_unit(self) -> Unit:
        return self._units.position_unit(self._view.stroke_m, turns=self._view.turns)

    def _whole(self) -> Options:
        """Return all of it."""
        ink, changing = self._theme.ink, self._changing()
        quiet = {"axisLine": {"lineStyle": {"color": ink.grid}}, "axisLabel": {"color": ink.quiet, "hideOverlap": True}}
        inner = {"axisLabel": {"color": ink.quiet, "showMinLabel": False, "showMaxLabel": False}}
        hidden = quiet | {"axisLabel": {"show": False}}
        rule = {"splitLine": {"lineStyle": {"color": ink.grid}}}
        places = ({"top": 58, "height": 200}, {"top": 284, "height": 120})
        units = (self._position_unit().name, self._units.pressure.name)
        series = [
            line(
                getattr(ink, each.ink),
                each.dash,
                xAxisIndex=each.panel,
                yAxisIndex=each.panel,
                encode={"x": 0, "y": number},
                **change,
            )
            for number, (each, change) in enumerate(zip(LINES.values(), changing["series"], strict=True), start=1)
        ]
        for each in series:
            each["markArea"] |= {"silent": True, "label": {"color": ink.quiet, "position": "insideTop"}}
        return chart_options(
            ink,
            axisPointer={"link": [{"xAxisIndex": "all"}]},
            # No room is made for labels at the right end: of a narrow page it would be the lower panel's alone.
            grid=[{"left": 52, "right": 24, "outerBoundsMode": "none", **place} for place in places],
            dataset=changing["dataset"],
            xAxis=[
                {"type": "time", "gridIndex": number, "splitNumber": 4, **(quiet if number else hidden), **x}
                for number, x in enumerate(changing["xAxis"])
            ],
            yAxis=[
                {
                    "gridIndex": number,
                    "splitNumber": 4,
                    **axis_title(ink, f"{what}, {unit}"),
                    **quiet,
                    **inner,
                    **rule,
                    **y,
                }
                for number, (what, unit, y) in enumerate(
                    zip(("position", "pressure"), units, changing["yAxis"], strict=True)
                )
            ],
            series=series,
        )


def _range(drawn: Column, least: float) -> tuple[float | None, float | None]:
    """Return the ends of an axis, no shorter than `least`; none of what is not there.

    >>> _range(np.array([29.9, 30.1, np.nan]), 5.0)
    (27.1, 32.9)
    """
    finite = drawn[np.isfinite(drawn)]
    if not finite.size or not np.isfinite(least):
        return None, None
    low, high = float(finite.min()), float(finite.max())
    missing = max(0.0, least - (high - low)) / 2
    low, high = low - missing, high + missing
    room = ROOM * (high - low)
    digits = 1 - int(np.floor(np.log10(high - low)))
    return round(low - room, digits), round(high + room, digits)

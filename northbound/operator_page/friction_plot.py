"""Friction against its baseline: a row a minute since this page looks, before that an hourly row of the history."""

import time

from nicegui import ui

from northbound.observer.valve_view import ValveView
from northbound.operator_page.echart_options import Options, chart_options, line, quiet
from webpage.theme import Theme
from webpage.units import Units

FEWEST_LINE_ROWS = 2
"""Rows that a line needs."""


class FrictionPlot:
    """The lines of one valve in one tab; hidden until there are some."""

    def __init__(self, theme: Theme, view: ValveView, units: Units) -> None:
        self._theme = theme
        self._view = view
        self._units = units
        self._shown: object = None
        self._chart = ui.echart({}).classes("full-width").style("height: 150px")
        self._chart.props('data-testid="friction" role="img" aria-label="friction and its baseline over time"')
        self._chart.set_visibility(False)

    def refresh(self) -> None:
        """Draw it anew where there is something new, or other units or colours."""
        rows = self._view.friction
        shown = (len(rows), rows[-1:], self._units.pressure.name, self._theme.is_dark)
        if len(rows) < FEWEST_LINE_ROWS or shown == self._shown:
            return
        self._shown = shown
        self._chart.options.clear()
        self._chart.options.update(self._options(rows))
        self._chart.set_visibility(True)
        self._chart.update()

    def _options(self, rows: tuple[tuple[float, float, float], ...]) -> Options:
        ink, unit = self._theme.ink, self._units.pressure
        wall_s = time.time() - time.monotonic()
        styles = (("friction", ink.measured, "solid"), ("baseline", ink.model, "dashed"))
        return chart_options(
            ink,
            grid={"left": 52, "right": 12, "top": 30, "bottom": 24},
            xAxis=quiet(ink, type="time", splitNumber=3),
            yAxis=quiet(ink, min=0, splitNumber=3),
            series=[
                line(
                    colour,
                    dash,
                    name=f"{name}, {unit.name}",
                    step="end",
                    data=[[round(1e3 * (wall_s + row[0])), unit.per_si * row[column]] for row in rows],
                )
                for column, (name, colour, dash) in enumerate(styles, start=1)
            ],
        )

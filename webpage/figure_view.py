"""A plotly figure on a page, its colours those of the theme.

Data change without the figure being built anew: `restyle` and `move` send the lines that changed and nothing else.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from typing import Any

from nicegui import ui

from webpage.plot_colours import DARK, LIGHT, Ink
from webpage.theme import Theme

Figure = dict[str, Any]
SHOWN_AS = {ink: {getattr(LIGHT, each.name): getattr(ink, each.name) for each in fields(Ink)} for ink in (LIGHT, DARK)}
"""Of each theme: its colours by those of the light one, in which figures are drawn."""
AT_ONCE = {"mode": "immediate", "transition": {"duration": 0}, "frame": {"duration": 0, "redraw": False}}
UNUSED = ["lasso2d", "zoomIn2d", "zoomOut2d", "autoScale2d"]
CONFIG = {"displaylogo": False, "scrollZoom": True, "responsive": True, "modeBarButtonsToRemove": UNUSED}
LEGEND = {"orientation": "h", "x": 0, "y": 0, "xanchor": "left", "yanchor": "bottom", "yref": "container"}
"""Below, where it is in nobody's way however many lines it takes on a narrow screen."""
BAR_PX = 30
"""Above a plot, for its buttons: a screen that is touched shows them always."""


class FigureView:
    """Shows what `draw` returns; `draw` is asked again when the colours change."""

    def __init__(self, theme: Theme, draw: Callable[[], Figure], height_px: int, name: str) -> None:
        self._draw = draw
        self._theme = theme
        self.plot = ui.plotly(self._apply_theme()).classes("w-full").style(f"height: {height_px}px")
        self.plot.props(f'data-testid="{name}" role="img" aria-label="{name}"')
        theme.listen(self.redraw)

    def redraw(self) -> None:
        """Draw it anew, if it is still there."""
        if self.plot.is_deleted:
            return
        self.plot.update_figure(self._apply_theme())

    def restyle(self, changes: Mapping[str, Sequence[Any]], traces: Sequence[int]) -> None:
        """Change some traces: for each attribute a value a trace."""
        self.plot.run_plot_method("restyle", dict(changes), list(traces))

    async def move(self, changes: Mapping[str, Sequence[Any]], traces: Sequence[int]) -> None:
        """Change some traces at once, in half the time of `restyle`: the axes stay as they are. Ends when it is drawn.

        Raises:
            TimeoutError: the browser has not drawn it.
        """
        frame = [dict(zip(changes, each, strict=True)) for each in zip(*changes.values(), strict=True)]
        drawn = self.plot.run_plot_method("animate", {"data": frame, "traces": list(traces)}, AT_ONCE)
        await drawn

    def relayout(self, changes: Mapping[str, Any]) -> None:
        """Change the layout."""
        self.plot.run_plot_method("relayout", _recolour(dict(changes), SHOWN_AS[self._theme.ink]))

    def _apply_theme(self) -> Figure:
        ink = self._theme.ink
        figure = _recolour(self._draw(), SHOWN_AS[ink])
        layout = dict(figure.get("layout", {}))
        layout |= {
            "margin": {**layout["margin"], "t": max(BAR_PX, layout["margin"]["t"])},
            "legend": LEGEND,
            "modebar": {"bgcolor": "rgba(0,0,0,0)", "color": ink.quiet, "activecolor": ink.text},
            "paper_bgcolor": "rgba(0,0,0,0)",
            "plot_bgcolor": "rgba(0,0,0,0)",
            "font": {**layout.get("font", {}), "color": ink.text},
            "hoverlabel": {"bgcolor": ink.paper, "bordercolor": ink.grid, "font": {"color": ink.text}},
        }
        for name, axis in layout.items():
            if name.startswith(("xaxis", "yaxis")):
                layout[name] = {**axis, "gridcolor": ink.grid, "linecolor": ink.grid, "tickcolor": ink.grid}
        return {"data": figure["data"], "layout": layout, "config": CONFIG}


def _recolour(part: Any, colours: Mapping[str, str]) -> Any:
    """Return a figure, or a part of it, with the light theme's colours changed to those of the theme."""
    if isinstance(part, dict):
        return {key: _recolour(value, colours) for key, value in part.items()}
    if isinstance(part, list) and part and isinstance(part[0], dict):
        return [_recolour(each, colours) for each in part]
    return colours.get(part, part) if isinstance(part, str) else part

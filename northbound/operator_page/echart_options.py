"""What the charts of the page share (ECharts): no animation, legend and tooltip in the theme's colours, a line."""

from typing import Any

from webpage.plot_colours import Ink

Options = dict[str, Any]

DASHES = {"itemWidth": 30, "itemStyle": {"opacity": 0}}
"""Of a legend: a line is drawn there as it is in the plot, dashed or not, and without a mark on it."""


def chart_options(ink: Ink, **options: Any) -> Options:
    """Return the options of a chart."""
    return {
        "animation": False,
        "textStyle": {"fontFamily": "inherit"},
        "legend": {"top": 0, "left": 0, **DASHES, "textStyle": {"color": ink.text}},
        "tooltip": {"trigger": "axis", "backgroundColor": ink.paper, "textStyle": {"color": ink.text}},
        **options,
    }


def quiet(ink: Ink, **options: Any) -> Options:
    """Return the options of an axis."""
    return {"axisLabel": {"color": ink.quiet}, "splitLine": {"lineStyle": {"color": ink.grid}}, **options}


def axis_title(ink: Ink, name: str) -> Options:
    """Return how an axis is called, above its upper end."""
    style = {"color": ink.quiet, "align": "left", "padding": [0, 0, 0, -40]}
    return {"name": name, "nameTextStyle": style, "nameGap": 8}


def line(colour: str, dash: str, **options: Any) -> Options:
    """Return a line; what is asked for, dashed or dotted, stands before what is measured, and goes in steps."""
    measured = dash == "solid"
    return {
        "type": "line",
        "showSymbol": False,
        "z": 2 if measured else 3,
        "step": False if measured else "end",
        "lineStyle": {"width": 1.6, "color": colour, "type": dash},
        "itemStyle": {"color": colour},
        **options,
    }

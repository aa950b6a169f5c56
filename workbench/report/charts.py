"""What all plots share, and the small ones: profiles, correlations, the spectrum. Figures as plotly.js takes them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from webpage.plot_colours import LIGHT
from workbench.compare.residuals import Correlation, Profile, Spectrum
from workbench.report.display_units import Reading
from workbench.report.plot_series import significant

Figure = dict[str, Any]
Trace = dict[str, Any]

INK, QUIET, GRID = LIGHT.text, LIGHT.quiet, LIGHT.grid
MEASURED, MODEL, EXTENDED, BAND = LIGHT.measured, LIGHT.model, LIGHT.better, "rgba(31,42,55,0.08)"
OPEN = "#b8860b"
FONT = 'system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif'


def layout(**changes: Any) -> Figure:
    """Return the layout all plots share."""
    return {
        "font": {"family": FONT, "size": 12.5, "color": INK},
        "paper_bgcolor": "#ffffff",
        "plot_bgcolor": "#ffffff",
        "margin": {"l": 62, "r": 18, "t": 34, "b": 46},
        "hovermode": "closest",
        "hoverlabel": {"bgcolor": "#ffffff", "bordercolor": GRID, "font": {"color": INK}},
        "legend": {"orientation": "h", "x": 0, "y": 1.0, "xanchor": "left", "yanchor": "bottom"},
        **changes,
    }


def axis(title: str, **changes: Any) -> Figure:
    """Return an axis."""
    return {
        "title": {"text": title, "standoff": 8},
        "gridcolor": GRID,
        "zeroline": False,
        "linecolor": GRID,
        "ticks": "outside",
        "tickcolor": GRID,
        "automargin": True,
        **changes,
    }


def over_time(
    position: str, asked: str, ends_s: tuple[float, float], *, ground: bool = False, **changes: Any
) -> Figure:
    """Return the layout of position, its error and what was asked, one below the other over one time axis.

    Args:
        position: what it is called, and its unit.
        asked: the same of what was asked.
        ends_s: of the time that is shown.
        ground: position and error stand before ordinates from 0 to 1, y4 and y5, which have their places then.
        changes: of the layout.
    """
    above: Figure = {"domain": [0.52, 1.0]}
    middle: Figure = {"domain": [0.24, 0.47]}
    behind = {}
    if ground:
        hidden = {"range": [0, 1], "visible": False, "fixedrange": True}
        behind = {"yaxis4": above | hidden, "yaxis5": middle | hidden}
        above, middle = {"overlaying": "y4"}, {"overlaying": "y5"}
    spikes = {"showspikes": True, "spikemode": "across", "spikethickness": 1, "spikecolor": QUIET}
    zero = {"zeroline": True, "zerolinecolor": QUIET, "zerolinewidth": 1}
    return layout(
        dragmode="zoom",
        xaxis=axis("time, s", anchor="y3", range=list(ends_s), **spikes),
        yaxis=axis(position, **above),
        yaxis2=axis(f"error, {position.rpartition(', ')[2]}", **zero, **middle),
        yaxis3=axis(asked, domain=[0.0, 0.19], nticks=4),
        **behind,
        **changes,
    )


def line(
    x: Sequence[float | None], y: Sequence[float | None], name: str, colour: str, hover: str, **changes: Any
) -> Trace:
    """Return a line; `hover` as plotly's template. With `mode="markers"` and a `marker` they are points."""
    return {
        "type": "scatter",
        "mode": "lines",
        "x": list(x),
        "y": list(y),
        "name": name,
        "line": {"color": colour, "width": 1.4},
        "hovertemplate": hover + f"<extra>{name}</extra>",
        **changes,
    }


def profiles(
    parts: Sequence[tuple[str, str, Profile]],
    over: tuple[str, float],
    value: tuple[str, float, str, str],
) -> Figure:
    """Return means with their standard errors.

    Args:
        parts: name, colour, profile.
        over: title of the abscissa, and its factor from SI.
        value: title of the ordinate, its factor from SI, the unit shown and the SI unit.
    """
    title, factor, unit, si = value
    traces = [
        {
            "type": "scatter",
            "mode": "lines+markers",
            "name": name,
            "x": significant(over[1] * each.centre),
            "y": significant(factor * each.mean),
            "error_y": {"type": "data", "array": significant(factor * each.standard_error), "thickness": 1, "width": 0},
            "customdata": significant(each.mean),
            "line": {"color": colour, "width": 1.4},
            "marker": {"color": colour, "size": 6, "symbol": symbol},
            "hovertemplate": f"%{{y:.4~g}} {unit} (%{{customdata:.4~g}} {si})<br>at %{{x:.4~g}}<extra>{name}</extra>",
        }
        for (name, colour, each), symbol in zip(parts, _symbols(len(parts)), strict=True)
    ]
    return {
        "data": traces,
        "layout": layout(
            xaxis=axis(over[0]),
            yaxis=axis(title, zeroline=True, zerolinecolor=QUIET, zerolinewidth=1),
            showlegend=len(parts) > 1,
        ),
    }


def _symbols(count: int) -> list[str]:
    return ["circle", "diamond", "circle-open", "diamond-open"][:count]


def correlation(each: Correlation, title: str) -> Figure:
    """Return the correlation by lag, with its band."""
    lag_s = significant(each.lag_s)
    bars: Trace = {
        "type": "bar",
        "x": lag_s,
        "y": significant(each.value),
        "marker": {"color": [MODEL if abs(value) > each.band else QUIET for value in each.value.tolist()]},
        "hovertemplate": "%{y:.3f} at a shift of %{x:.4~g} s<extra></extra>",
    }
    band = {
        "type": "rect", "xref": "paper", "x0": 0, "x1": 1, "y0": -each.band, "y1": each.band,
        "fillcolor": BAND, "line": {"width": 0}, "layer": "below",
    }  # fmt: skip
    reach = 1.05 * max(float(np.max(np.abs(each.value), initial=0.0)), each.band)
    return {
        "data": [bars],
        "layout": layout(
            xaxis=axis("shift in time, s"),
            yaxis=axis(title, range=[-reach, reach], zeroline=True, zerolinecolor=QUIET),
            shapes=[band],
            showlegend=False,
        ),
    }


def spectrum(each: Spectrum, read: Reading) -> Figure:
    """Return the spectrum as amplitude density, a length over root Hz."""
    length = read.kind.length
    seen = each.frequency_hz > 0.0
    density = np.sqrt(each.density_m2_per_hz[seen])
    trace = line(
        significant(each.frequency_hz[seen]),
        significant(length.factor * density),
        "error",
        MODEL,
        f"%{{y:.3~g}} {length.unit}/√Hz (%{{customdata:.3~g}} {read.si}/√Hz)<br>at %{{x:.3~g}} Hz",
        customdata=significant(density),
    )
    return {
        "data": [trace],
        "layout": layout(
            xaxis=axis("frequency, Hz", type="log"),
            yaxis=axis(f"error, {length.unit}/√Hz", type="log"),
            showlegend=False,
        ),
    }


def mark_line(x: float, colour: str, dash: str = "dash") -> Mapping[str, Any]:
    """Return a vertical line across the plot."""
    return {
        "type": "line", "x0": x, "x1": x, "yref": "paper", "y0": 0, "y1": 1,
        "line": {"color": colour, "width": 1.5, "dash": dash},
    }  # fmt: skip

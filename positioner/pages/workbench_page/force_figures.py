"""Friction, as the balance of forces leaves it, over velocity and over position; samples of the time window stand out.

F_f = A p + load - k_s x - m x''        N, of samples in motion (`workbench.compare.friction_balance`)
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from positioner.pages.parts.theme import Ink
from positioner.pages.workbench_page.time_figure import Window
from workbench.compare.friction_balance import Forces
from workbench.report.charts import Figure, axis, layout
from workbench.report.plot_series import rounded

MOST = 700
"""Points of a cloud."""
OVER = {"velocity": ("velocity, mm/s (opening +)", "velocity_m_per_s"), "position": ("position, mm", "position_m")}


def force_figure(over: str, clouds: tuple[Forces, Forces], begin_s: float, window: Window, ink: Ink) -> Figure:
    """Return friction of the measurement and of the model over `velocity` or `position`.

    Args:
        over: what it is drawn over.
        clouds: measured, model.
        begin_s: the recording's first time.
        window: samples in it stand out; s since the start.
        ink: colours.
    """
    title, field = OVER[over]
    traces = []
    kinds = (("measured", ink.measured, clouds[0], "circle-open", 7), ("model", ink.model, clouds[1], "circle", 3))
    for name, colour, cloud, symbol, size in kinds:
        rows = _thinned(cloud.friction_n.size)
        at_s = cloud.time_s[rows] - begin_s
        inside = (at_s >= window.begin_s) & (at_s <= window.end_s)
        for seen, opacity in ((~inside, 0.15), (inside, 0.85)):
            marker = {"opacity": opacity, "size": size, "symbol": symbol, "color": colour}
            traces.append(_cloud(name, cloud, field, rows[seen], begin_s, marker))
    figure_layout = layout(
        margin={"l": 62, "r": 10, "t": 8, "b": 40},
        dragmode="select",
        showlegend=False,
        uirevision=over,
        xaxis=axis(title),
        yaxis=axis("friction, N"),
    )
    return {"data": traces, "layout": figure_layout}


def _cloud(
    name: str, cloud: Forces, field: str, rows: NDArray[np.int64], begin_s: float, marker: dict[str, Any]
) -> Figure:
    x: Column = getattr(cloud, field)
    return {
        "type": "scatter", "mode": "markers", "name": name,
        "x": rounded(1e3 * x[rows], 4), "y": rounded(cloud.friction_n[rows], 2),
        "customdata": rounded(cloud.time_s[rows] - begin_s, 4),
        "marker": marker,
        "hovertemplate": "%{y:.4~g} N at %{x:.4~g}, %{customdata:.3f} s<extra>" + name + "</extra>",
    }  # fmt: skip


def _thinned(count: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, max(0, count - 1), min(count, MOST)).astype(np.int64))

"""Friction, as the balance of forces leaves it, over velocity and over position; samples of the time window stand out.

F_f = A p + load - k_s x - m x''        N, of samples in motion (`workbench.compare.friction_balance`)
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from webpage.units import Unit
from workbench.compare.friction_balance import Forces
from workbench.page.time_figure import Window
from workbench.report.charts import EXTENDED, MEASURED, MODEL, Figure, Trace, axis, layout, line
from workbench.report.plot_series import round_values

TIME_PLACES = 4  # digits after the point
MOST_CLOUD_POINTS = 700
"""Points of a cloud."""
OVER = {"velocity": ("velocity, {}/s (opening +)", "velocity_m_per_s"), "position": ("position, {}", "position_m")}


@dataclass(frozen=True, slots=True)
class Seen:
    """What stands out: samples of a window of time, and those chosen in another plot, s since the start."""

    begin_s: float
    """Of the recording, as its samples count time."""
    window: Window
    chosen_s: tuple[float, ...]


def force_figure(over: str, clouds: tuple[Forces, Forces], seen: Seen, unit: Unit) -> Figure:
    """Return friction of the measurement and of the model over `velocity` or `position`.

    Args:
        over: what it is drawn over.
        clouds: measured, model.
        seen: what stands out.
        unit: of positions.
    """
    title, field = OVER[over]
    traces = []
    kinds = (("measured", MEASURED, clouds[0], "circle-open", 7), ("model", MODEL, clouds[1], "circle", 3))
    for name, colour, cloud, symbol, size in kinds:
        rows = _thin_rows(cloud.friction_n.size)
        at_s = cloud.time_s[rows] - seen.begin_s
        inside = (at_s >= seen.window.begin_s) & (at_s <= seen.window.end_s)
        chosen = np.isin(np.round(at_s, TIME_PLACES), np.round(np.array(seen.chosen_s), TIME_PLACES))
        kinds_of = ((~inside & ~chosen, 0.15, colour), (inside & ~chosen, 0.85, colour), (chosen, 1.0, EXTENDED))
        for which, opacity, drawn in kinds_of:
            marker = {"opacity": opacity, "size": size, "symbol": symbol, "color": drawn}
            traces.append(_cloud(name, cloud, field, rows[which], seen.begin_s, unit.per_si, marker))
    figure_layout = layout(
        margin={"l": 62, "r": 10, "t": 8, "b": 40},
        dragmode="select",
        showlegend=False,
        uirevision=f"{over}, {unit.name}",
        xaxis=axis(title.format(unit.name)),
        yaxis=axis("friction, N"),
    )
    return {"data": traces, "layout": figure_layout}


def _cloud(
    name: str, cloud: Forces, field: str, rows: NDArray[np.int64], begin_s: float, per_si: float, marker: dict[str, Any]
) -> Trace:
    x: Column = getattr(cloud, field)
    at, height = round_values(per_si * x[rows], 4), round_values(cloud.friction_n[rows], 2)
    at_s, hover = (
        round_values(cloud.time_s[rows] - begin_s, TIME_PLACES),
        "%{y:.4~g} N at %{x:.4~g}, %{customdata:.3f} s",
    )
    return line(at, height, name, marker["color"], hover, mode="markers", marker=marker, customdata=at_s)


def _thin_rows(count: int) -> NDArray[np.int64]:
    return np.unique(np.linspace(0, max(0, count - 1), min(count, MOST_CLOUD_POINTS)).astype(np.int64))

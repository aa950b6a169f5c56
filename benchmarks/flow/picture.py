"""Pictures of flow loops, drawn without a screen: a row a course, flow on the left, reference and stem on the right."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl

from benchmarks.flow.course import FlowCourse

if TYPE_CHECKING:
    from matplotlib.axes import Axes

mpl.use("Agg")

FLOW_COLOUR, REFERENCE_COLOUR, STEM_COLOUR, LEAST_COLOUR = "#1f6f3f", "#c0392b", "#1f3a5f", "#999999"
ROW_INCHES = 1.5


def draw_flow(
    path: Path, courses: Mapping[str, FlowCourse], frictionless: FlowCourse, setpoint: float, from_s: float
) -> None:
    """Draw courses, each under its title, from a time on, s; all on the same scales."""
    from matplotlib import pyplot as plt

    figure, rows = plt.subplots(
        len(courses),
        2,
        sharex=True,
        sharey="col",
        squeeze=False,
        figsize=(12, 1 + ROW_INCHES * len(courses)),
        layout="constrained",
    )
    for (left, right), (title, course) in zip(rows, courses.items(), strict=True):
        _draw_deviation(left, course, frictionless, setpoint, from_s)
        _draw_stem(right, course, from_s)
        left.set_title(title, fontsize=9, loc="left")
    for axes in rows[-1]:
        axes.set_xlabel("time, s")
    figure.supylabel("flow less setpoint, % of full flow", fontsize=9)
    handles = [line for axes in rows[0] for line in axes.get_lines()]
    figure.legend(handles=handles, loc="outside upper center", ncols=4, frameon=False)
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _draw_deviation(axes: "Axes", course: FlowCourse, frictionless: FlowCourse, setpoint: float, from_s: float) -> None:
    for each, colour, label in (
        (course, FLOW_COLOUR, "flow"),
        (frictionless, LEAST_COLOUR, "flow of a valve without friction"),
    ):
        shown = each.time_s >= from_s
        axes.plot(each.time_s[shown] - from_s, 100 * (each.flow[shown] - setpoint), color=colour, lw=1, label=label)
    axes.grid(alpha=0.3)


def _draw_stem(axes: "Axes", course: FlowCourse, from_s: float) -> None:
    shown = course.time_s >= from_s
    time_s = course.time_s[shown] - from_s
    axes.plot(time_s, course.stem_pu[shown], color=STEM_COLOUR, lw=0.7, label="stem position, p.u. of stroke")
    axes.step(
        time_s, course.reference_pu[shown], where="post", color=REFERENCE_COLOUR, lw=1, label="reference of the DCS"
    )
    axes.grid(alpha=0.3)

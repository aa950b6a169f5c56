"""Position measured and simulated, the error, command and pressure over one time axis, of any length of recording.

What is drawn is the window that is looked at: of each of some thousand equal stretches of it the least and the greatest
sample (`workbench.report.plot_series`). Going closer draws the window anew, so that at the end every sample is seen.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from config.drive import VALVE
from config.recording import Column
from webpage.units import Unit, Units
from workbench.compare.comparison_sentences import Stretch, slip_sentences
from workbench.compare.slip_matching import SlipEvents
from workbench.data.record import Record
from workbench.report.charts import EXTENDED, MEASURED, MODEL, QUIET, Figure, Trace, line, over_time
from workbench.report.plot_series import extremes, round_values, running_s

MOST_LINE_POINTS, MOVING = 2400, 1200
"""Points of a line in the window at most; and while a slider moves it, when it is drawn many times a second."""
AROUND_S, AROUND = 2.0, 0.5
"""Before and after what is gone to: so many seconds at the least, and this part of a long stretch."""
BESIDE_SHARE = 0.5
"""Of the window, drawn on either side of it: panning finds something there."""
LINES = ("measured", "as opened", "fitted", "saved", "model", "error as opened", "error fitted", "error saved", "error",
         "command", "pressure", "model's pressure")  # fmt: skip
BELOW = ("command", "pressure", "model's pressure")
MARKS = ("missed slip", "spurious slip", "matched slip", "chosen")
SLIPS = ("missed", "spurious", "matched")
"""What the first of them mark."""
MARKED = {
    "missed slip": ("triangle-up", MODEL, 11),
    "spurious slip": ("triangle-down-open", MODEL, 11),
    "matched slip": ("circle-open", QUIET, 5),
    "chosen": ("circle", EXTENDED, 6),
}


@dataclass(frozen=True, slots=True)
class Window:
    """A stretch of time that is looked at, s since the start."""

    begin_s: float
    end_s: float


class TimeFigure:
    """The lines of a recording of a valve of a stroke, m, SI, by the names of LINES; what is None is not drawn."""

    def __init__(self, record: Record, stroke_m: float, units: Units) -> None:
        self._stroke_m = stroke_m
        self._units = units
        self._along_s = running_s(record.time_s)
        self._by_setpoint = record.by_setpoint
        self._record = record
        self._lines: dict[str, Column | None] = dict.fromkeys(LINES)
        self._lines["measured"] = np.where(record.valid, record.position_m, np.nan)
        self._lines["command"] = record.command_pa
        self._lines["pressure"] = record.pressure_pa
        self.slips = SlipEvents((), (), ())
        self.chosen_s: tuple[float, ...] = ()
        """Times, s since the start, of samples that were chosen in another plot."""
        self.stretch: Stretch | None = None
        """What a sentence speaks of: it is shaded."""
        self.window = self.whole

    @property
    def whole(self) -> Window:
        """All of it."""
        return Window(0.0, float(self._along_s[-1]))

    def show(self, name: str, position_m: Column | None) -> None:
        """Draw a model's position, m, (n,) and its error; `name` is as opened, fitted, saved or model."""
        error = "error" if name == "model" else f"error {name}"
        measured_m = self._lines["measured"]
        self._lines[name] = position_m
        self._lines[error] = None if position_m is None or measured_m is None else position_m - measured_m

    def show_pressure(self, pressure_pa: Column) -> None:
        """Draw the model's pressure, Pa, (n,)."""
        self._lines["model's pressure"] = None if self._by_setpoint else pressure_pa

    def data(self, names: tuple[str, ...] = LINES, most: int = MOST_LINE_POINTS) -> Mapping[str, list[Any]]:
        """Return x and y of these lines in the window, a list each, of so many points at most."""
        drawn = [self._points(self._lines[name], self._unit(name).per_si, most) for name in names]
        return {"x": [x for x, _ in drawn], "y": [y for _, y in drawn]}

    def marks(self) -> Mapping[str, list[Any]]:
        """Return x, y and what is said of the marks, a list each."""
        said = slip_sentences(self.slips, VALVE.length)
        texts = [*(list(said[kind]) for kind in SLIPS), []]
        per_si = self._unit("measured").per_si
        times = (self.slips.missed_s, self.slips.spurious_s, tuple(each.time_s for each in self.slips.matched),
                 self.chosen_s)  # fmt: skip
        begin_s = self._record.time_s - self._record.time_s[0]
        x, y = [], []
        for each in times:
            at = np.asarray(each, np.float64)
            rows = np.clip(np.searchsorted(begin_s, at), 0, begin_s.size - 1)
            x.append(round_values(self._along_s[rows], 4))
            y.append(round_values(per_si * self._record.position_m[rows], 4))
        return {"x": x, "y": y, "text": texts}

    def figure(self) -> Figure:
        """Return all of it as plotly takes it."""
        x, y = self.data().values()
        traces = [self._trace(name, xs, ys) for name, xs, ys in zip(LINES, x, y, strict=True)]
        for name, xs, ys, said in zip(MARKS, *self.marks().values(), strict=True):
            symbol, colour, size = MARKED[name]
            marker = {"symbol": symbol, "size": size, "color": colour, "line": {"width": 2}}
            points = {"mode": "markers", "marker": marker, "text": said, "showlegend": bool(xs)}
            traces.append(line(xs, ys, name, colour, "%{x:.3f} s<br>%{text}", **points))
        position, asked = self._unit("measured").name, self._unit("command").name
        figure_layout = over_time(
            f"position, {position}",
            f"{'set point' if self._by_setpoint else 'pressure'}, {asked}",
            (self.window.begin_s, self.window.end_s),
            margin={"l": 58, "r": 12, "t": 8, "b": 40},
            uirevision=f"time, {position}, {asked}",
            shapes=self.shades(),
        )
        return {"data": traces, "layout": figure_layout}

    def _trace(self, name: str, x: list[Any], y: list[Any]) -> Trace:
        y_axis = "y2" if name.startswith("error") else "y3" if name in BELOW else "y"
        dash = "dot" if "as opened" in name else "dash" if "saved" in name else "solid"
        style = {"color": _colour(name), "width": 1.4, "dash": dash, "shape": "hv" if name == "command" else "linear"}
        hover, shown = f"%{{y:.4~g}} {self._unit(name).name} at %{{x:.3f}} s", bool(x) and y_axis == "y"
        return line(x, y, name, _colour(name), hover, line=style, yaxis=y_axis, showlegend=shown, connectgaps=False)

    def shades(self) -> list[Figure]:
        """Return what shades the stretch that a sentence speaks of."""
        if self.stretch is None:
            return []
        ends = {"x0": self.stretch.begin_s, "x1": self.stretch.end_s, "y0": 0, "y1": 1, "yref": "paper"}
        edge = {"color": EXTENDED, "width": 1}
        return [{"type": "rect", "fillcolor": EXTENDED, "opacity": 0.18, "layer": "below", "line": edge, **ends}]

    def _unit(self, name: str) -> Unit:
        is_pressure = name in BELOW and not self._by_setpoint
        return self._units.pressure if is_pressure else self._units.position_unit(self._stroke_m)

    def _points(self, values: Column | None, per_si: float, most: int) -> tuple[list[float | None], list[float | None]]:
        if values is None:
            return [], []
        width_s = self.window.end_s - self.window.begin_s
        ends_s = (
            self.window.begin_s - BESIDE_SHARE * width_s,
            self.window.end_s + BESIDE_SHARE * width_s,
        )
        first, end = np.searchsorted(self._along_s, ends_s)
        first, end = max(0, int(first) - 1), min(self._along_s.size, int(end) + 1)
        rows = first + extremes(values[first:end], most)
        return round_values(self._along_s[rows], 5), round_values(per_si * values[rows], 5)


def _colour(name: str) -> str:
    if name in ("measured", "pressure"):
        return MEASURED
    if "fitted" in name:
        return EXTENDED
    return QUIET if "opened" in name or "saved" in name or name == "command" else MODEL


def around(stretch: Stretch) -> Window:
    """Return the window in which a stretch is looked at."""
    more_s = max(AROUND_S, AROUND * (stretch.end_s - stretch.begin_s))
    return Window(stretch.begin_s - more_s, stretch.end_s + more_s)


def window_of(changes: Mapping[str, Any], whole: Window) -> Window | None:
    """Return the window that a change of a plot's layout shows; None if the time axis stays."""
    if changes.get("xaxis.autorange"):
        return whole
    ends = [changes.get(f"xaxis.range[{i}]") for i in range(2)]
    if isinstance(changes.get("xaxis.range"), list):
        ends = changes["xaxis.range"]
    begin_s, end_s = ends
    if not isinstance(begin_s, int | float) or not isinstance(end_s, int | float):
        return None
    return Window(float(begin_s), float(end_s))

"""The overlay: measured and simulated position, the error below, the command at the foot; one time axis for all.

Behind them stand the phases, or what was held out; triangles mark slips that the model misses or makes without cause.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.recording import Column
from workbench.compare.phases import PHASES, STUCK
from workbench.compare.slip_matching import SlipEvents
from workbench.report.charts import MEASURED, QUIET, Figure, Trace, line, over_time
from workbench.report.display_units import OF_VALVE, Reading
from workbench.report.plot_series import draw_series, round_values, running_s

SHADES = {
    "slipping up": "rgba(60,130,200,0.13)",
    "slipping down": "rgba(217,160,43,0.17)",
    "reversal": "rgba(150,90,170,0.13)",
    "near stops": "rgba(90,100,115,0.16)",
}
HELD_OUT = "rgba(27,127,121,0.10)"
MOST_SHADED_COLUMNS = 4000
"""Columns in which phases are shaded at most."""
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Simulated:
    """One model's position, m, a value a sample."""

    name: str
    colour: str
    position_m: Column


@dataclass(frozen=True, slots=True)
class Shade:
    """Samples with a coloured ground."""

    name: str
    colour: str
    rows: Mask


class Asked(NamedTuple):
    """What was asked of a valve, and how it is drawn."""

    name: str
    unit: str
    si: str
    factor: float
    """From SI to the unit drawn."""
    digits: int
    """After the point, in SI."""


def _command_label(read: Reading, by_setpoint: bool) -> Asked:
    length, command = read.kind.length, read.kind.command.read
    if by_setpoint:
        return Asked("set point", length.unit, read.si, length.factor, 7)
    fine = 0 if read.kind.name == "valve" else 7
    return Asked("command", command.unit, read.kind.command.si, command.factor, fine)


def overlay(
    time_s: Column,
    command_pa: Column,
    measured_m: Column,
    models: Sequence[Simulated],
    shades: Sequence[Shade],
    slips: SlipEvents | None = None,
    *,
    by_setpoint: bool = False,
    read: Reading = OF_VALVE,
) -> Figure:
    """Return the figure; time, s, command, Pa, and positions, m, are (n,), NaN where there is nothing.

    Behind a positioner (`by_setpoint`) the command is a set point, m.
    """
    traces: list[Trace] = [*_grounds(time_s, shades)]
    traces.append(_position(time_s, measured_m, "measured", MEASURED, "y", read))
    for each in models:
        traces.append(_position(time_s, each.position_m, each.name, each.colour, "y", read))
        error_m = each.position_m - measured_m
        traces.append(_position(time_s, error_m, f"error, {each.name}", each.colour, "y2", read, showlegend=False))
    if slips is not None and bool(np.all(np.diff(time_s) > 0.0)):
        traces += _marks(time_s, measured_m, slips, read.kind.length.factor)
    command = draw_series(time_s, command_pa)
    asked = _command_label(read, by_setpoint)
    traces.append(
        line(
            round_values(command.time_s, 5),
            round_values(asked.factor * command.value, 3),
            asked.name,
            QUIET,
            f"%{{y:.2f}} {asked.unit} (%{{customdata:.6~g}} {asked.si})<br>at %{{x:.3f}} s",
            customdata=round_values(command.value, asked.digits),
            yaxis="y3",
            showlegend=False,
        )
    )
    ends_s, titles = (0.0, float(running_s(time_s)[-1])), (read.title("position, mm"), f"{asked.name}, {asked.unit}")
    margin = {"l": 62, "r": 18, "t": 60, "b": 46}
    return {"data": traces, "layout": over_time(*titles, ends_s, ground=bool(shades), margin=margin)}


def phase_shades(phase: NDArray[np.int64], valid: Mask) -> list[Shade]:
    """Return a ground for each phase but rest; indices into PHASES and mask, (n,) each."""
    return [
        Shade(name, SHADES[name], valid & (phase == i))
        for i, name in enumerate(PHASES)
        if i != STUCK and bool(np.any(valid & (phase == i)))
    ]


def _position(
    time_s: Column, position_m: Column, name: str, colour: str, y_axis: str, read: Reading, **changes: object
) -> Trace:
    series = draw_series(time_s, position_m)
    return line(
        round_values(series.time_s, 5),
        round_values(read.kind.length.factor * series.value, 4),
        name,
        colour,
        f"%{{y:.3f}} {read.kind.length.unit} (%{{customdata:.5~g}} {read.si})<br>at %{{x:.3f}} s",
        customdata=round_values(series.value, 7),
        yaxis=y_axis,
        **changes,
    )


def _grounds(time_s: Column, shades: Sequence[Shade]) -> Iterator[Trace]:
    along_s = running_s(time_s)
    stride = max(1, time_s.size // MOST_SHADED_COLUMNS)
    for shade in shades:
        x: list[float | None] = []
        y: list[float | None] = []
        for first, end in _runs(shade.rows[::stride]):
            begins, ends = (float(along_s[min(row * stride, time_s.size - 1)]) for row in (first, end))
            x += [begins, begins, ends, ends, None]
            y += [0, 1, 1, 0, None]
        for axis_ in ("y4", "y5"):
            yield {
                "type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": shade.colour, "line": {"width": 0},
                "x": [each if each is None else round(each, 5) for each in x], "y": y, "yaxis": axis_,
                "name": shade.name, "legendgroup": shade.name, "showlegend": axis_ == "y4", "hoverinfo": "skip",
            }  # fmt: skip


def _runs(rows: Mask) -> Iterator[tuple[int, int]]:
    """Yield the half-open runs of true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], rows, [False]]).astype(np.int8)))
    yield from list(pairwise(edges.tolist()))[::2]


def _marks(time_s: Column, measured_m: Column, slips: SlipEvents, factor: float) -> Iterator[Trace]:
    along_s = time_s - time_s[0]
    for name, times, symbol, colour in (
        ("missed slip", slips.missed_s, "triangle-up", "#b4491b"),
        ("spurious slip", slips.spurious_s, "triangle-down-open", "#7a3fa0"),
    ):
        if times:
            rows = np.clip(np.searchsorted(along_s, np.asarray(times)), 0, time_s.size - 1)
            at, height = round_values(np.asarray(times, np.float64), 5), round_values(factor * measured_m[rows], 4)
            marker = {"symbol": symbol, "size": 11, "color": colour, "line": {"width": 2, "color": colour}}
            yield line(at, height, name, colour, "at %{x:.3f} s", mode="markers", marker=marker, yaxis="y")

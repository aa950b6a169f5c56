"""A recording before it is taken: position and command over time, small, as the chosen columns and units make it."""

from config.recording import Column, Recording
from webpage.units import Unit, Units
from workbench.report.charts import MEASURED, MODEL, Figure, Trace, axis, layout, line
from workbench.report.plot_series import extremes, round_values, running_s

MOST_DRAWN_POINTS = 900  # more than a screen has columns


def export_figure(recording: Recording, stroke_m: float, units: Units) -> Figure:
    """Return it; stroke, m, may be NaN."""
    by_setpoint = "command_pa" not in recording.columns
    position = units.position_unit(stroke_m)
    given = ("reference_m", "set point", position) if by_setpoint else ("command_pa", "command", units.pressure)
    along_s = running_s(recording.columns["time_s"])
    return {
        "data": [
            _line(along_s, recording.columns["position_m"], ("position", position, "y"), MEASURED),
            _line(along_s, recording.columns[given[0]], (given[1], given[2], "y2"), MODEL),
        ],
        "layout": layout(
            margin={"l": 58, "r": 12, "t": 8, "b": 40},
            showlegend=False,
            xaxis=axis("time, s", anchor="y2"),
            yaxis=axis(f"position, {position.name}", domain=[0.55, 1.0]),
            yaxis2=axis(f"{given[1]}, {given[2].name}", domain=[0.0, 0.45]),
        ),
    }


def _line(along_s: Column, values: Column, told: tuple[str, Unit, str], colour: str) -> Trace:
    name, unit, y_axis = told
    rows = extremes(values, MOST_DRAWN_POINTS)
    x, y = round_values(along_s[rows], 4), round_values(unit.per_si * values[rows], 5)
    return line(x, y, name, colour, f"%{{y:.4~g}} {unit.name} at %{{x:.3f}} s", yaxis=y_axis)

"""The signature of a valve: position over command, a loop whose width is friction; measured, and of each model.

What widens the loop is friction, what tilts it the spring, what bends it a spring or a sensor that is not straight, and
what shifts it whole a preload or a sensor's offset.
"""

from collections.abc import Sequence

from config.recording import Column
from workbench.report.charts import MEASURED, Figure, Trace, axis, layout, line
from workbench.report.display_units import Reading
from workbench.report.overlay import Simulated
from workbench.report.plot_series import extremes, round_values
from workbench.report.report_html import Html, plot, section

MOST_LOOP_POINTS = 6000
"""Points drawn of one loop at most."""
TOLD = (
    "Position over command. Friction widens the loop, the spring tilts it, a preload or a sensor's offset shifts it. "
    "Where measurement and model differ, the model lacks something."
)


def signature(command_pa: Column, measured_m: Column, models: Sequence[Simulated], read: Reading) -> Html:
    """Return the section; command, Pa, and positions, m, are (n,), NaN where there is nothing."""
    traces = [_loop(command_pa, measured_m, "measured", MEASURED, read)]
    traces += [_loop(command_pa, each.position_m, each.name, each.colour, read) for each in models]
    figure: Figure = {
        "data": traces,
        "layout": layout(xaxis=axis(read.title("command, kPa")), yaxis=axis(read.title("position, mm"))),
    }
    return section("signature", "The signature: position over command", plot("plot-signature", figure, 420, TOLD))


def _loop(command_pa: Column, position_m: Column, name: str, colour: str, read: Reading) -> Trace:
    rows, length, command = extremes(position_m, MOST_LOOP_POINTS), read.kind.length, read.kind.command.read
    return line(
        round_values(command.factor * command_pa[rows], 5),
        round_values(length.factor * position_m[rows], 4),
        name,
        colour,
        f"%{{y:.3f}} {length.unit} at %{{x:.4~g}} {command.unit}",
    )

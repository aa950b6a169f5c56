"""Pictures of recordings, drawn without a screen."""

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from config.codes import State

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from config.recording import Recording

mpl.use("Agg")

STATE_COLOURS = {
    State.S0_START: "#ececec",
    State.S1_UP: "#d9ecd9",
    State.S2_DOWN: "#d9e4f5",
    State.S3_IDENTIFY: "#fbe3c4",
}


def draw_runs(path: Path, runs: Mapping[str, "Recording"], stroke_m: float) -> None:
    """Draw runs side by side, each under its title: stem position with reference, and pressure, over time.

    The states are in the background.
    """
    from matplotlib import pyplot as plt

    durations_s = [float(each.time_s[-1] - each.time_s[0]) for each in runs.values()]
    figure, rows = plt.subplots(
        2,
        len(runs),
        squeeze=False,
        sharex="col",
        sharey="row",
        figsize=(11, 6),
        height_ratios=(2, 1),
        width_ratios=durations_s,
        layout="constrained",
    )
    for (title, recording), (above, below) in zip(runs.items(), rows.T, strict=True):
        _draw(above, below, recording, stroke_m)
        above.set_title(title, fontsize=10)
    rows[0][0].set_ylabel("p.u. of stroke")
    rows[1][0].set_ylabel("pressure, kPa")
    handles = [*rows[0][0].get_legend_handles_labels()[0], *_state_patches()]
    figure.legend(handles=handles, loc="outside upper center", ncols=6, frameon=False)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _draw(above: "Axes", below: "Axes", recording: "Recording", stroke_m: float) -> None:
    time_s = recording.time_s - recording.time_s[0]
    columns = recording.columns
    for axes in (above, below):
        _paint_states(axes, time_s, columns["state"])
        axes.grid(alpha=0.3)
    above.step(time_s, columns["reference_m"] / stroke_m, where="post", color="#c0392b", lw=1.2, label="reference")
    above.plot(time_s, recording.position_m / stroke_m, color="#1f3a5f", lw=1.2, label="stem position")
    below.step(time_s, recording.command_pa / 1e3, where="post", color="#555555", lw=1.0)
    below.set_xlabel("time, s")


def _paint_states(axes: "Axes", time_s: "np.ndarray", state: "np.ndarray") -> None:
    changes = np.flatnonzero(np.diff(state)) + 1
    edges = [0, *changes.tolist(), len(state) - 1]
    for start, end in pairwise(edges):
        axes.axvspan(time_s[start], time_s[end], color=STATE_COLOURS[State(int(state[start]))], lw=0)


def _state_patches() -> list[object]:
    from matplotlib.patches import Patch

    labels = {
        State.S0_START: "S0 start",
        State.S1_UP: "S1 up",
        State.S2_DOWN: "S2 down",
        State.S3_IDENTIFY: "S3 identify",
    }
    return [Patch(color=STATE_COLOURS[state], label=label) for state, label in labels.items()]

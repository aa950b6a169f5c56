"""Pictures of recordings, drawn without a screen."""

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


def draw_run(path: Path, recording: "Recording", stroke_m: float, title: str) -> None:
    """Draw stem position with reference, and pressure, over time; the states in the background."""
    from matplotlib import pyplot as plt

    time_s = recording.time_s - recording.time_s[0]
    columns = recording.columns
    figure, (above, below) = plt.subplots(
        2, 1, sharex=True, figsize=(11, 6), height_ratios=(2, 1), layout="constrained"
    )
    for axes in (above, below):
        _paint_states(axes, time_s, columns["state"])
        axes.grid(alpha=0.3)
    above.step(time_s, columns["reference_m"] / stroke_m, where="post", color="#c0392b", lw=1.2, label="reference")
    above.plot(time_s, recording.position_m / stroke_m, color="#1f3a5f", lw=1.2, label="stem position")
    above.set_ylabel("p.u. of stroke")
    below.step(time_s, recording.command_pa / 1e3, where="post", color="#555555", lw=1.0)
    below.set_ylabel("pressure, kPa")
    below.set_xlabel("time, s")
    handles = [*above.get_legend_handles_labels()[0], *_state_patches()]
    figure.legend(handles=handles, loc="outside upper center", ncols=6, frameon=False)
    above.set_title(title, fontsize=10)
    figure.savefig(path, dpi=110)
    plt.close(figure)


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

"""The seed's figures 3 to 7, with what is true, and what noise makes of them; drawn without a screen."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np

from benchmarks.paper.findings import LARGEST_ERROR_PU, by_the_seeds_law, seed_friction, seed_ratios
from benchmarks.paper.formulas import (
    PRINTED_10,
    ParameterTracks,
    corrected_filters,
    derivatives,
    fir_length,
    printed_filters,
    solved,
    tracks,
)
from benchmarks.paper.scenario import S1_FROM_S, S2_FROM_S, UNTIL_S, ScenarioRun
from config.codes import State
from config.valve_file import ValveFile
from positioner.virtual.run_picture import STATE_COLOURS
from positioner.virtual.true_parameters import truth

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from positioner.estimation.array import Array

mpl.use("Agg")

COLOURS = ("#1f6f3f", "#2a5d9f", "#c0392b")
"""No noise, the sine of 1e5 rad/s, white noise."""
DOTS_PER_INCH = 90
JERK_S = (0.0, 0.04)
SLOW_S = (0.7, 0.7005)
"""Half a millisecond: long enough to see the sine."""


def draw_all(folder: Path, quiet: ScenarioRun, noisy: Sequence[ScenarioRun], file: ValveFile) -> list[Path]:
    """Draw every figure; return where they are.

    Args:
        folder: where to.
        quiet: the run without noise.
        noisy: that with the sine of 1e5 rad/s, and that with white noise.
        file: the valve.
    """
    true = truth(file.valve)
    seed_tracks = [(run, tracks(run)) for run in (quiet, *noisy)]
    printed = _by_printed_10(quiet)
    names = {3: ("a", "1/s"), 4: ("b", "1/s$^2$"), 5: ("c", "m/(s$^2$ Pa)")}
    paths = []
    for i, (number, (name, unit)) in enumerate(names.items()):
        paths.append(folder / f"seed-fig{number}.png")
        title = f"by (13), corrected; with (10) as printed ${name}_e$ = {printed[i]:.3g} at 0.8 s, off the scale"
        _draw_estimate(paths[-1], name, unit, true[name], [(run, each.theta[i]) for run, each in seed_tracks], title)
    paths.append(folder / "seed-derivatives.png")
    _draw_derivatives(paths[-1], quiet, noisy[0])
    paths.append(folder / "seed-fig6.png")
    friction = [(run, seed_friction(run, each)) for run, each in seed_tracks]
    _draw_estimate(paths[-1], "k", "m/s$^2$", true["k"], friction, "by (22), corrected, instant by instant")
    paths.append(folder / "seed-fig7.png")
    _draw_tracking(paths[-1], seed_tracks, file)
    return paths


def _by_printed_10(run: ScenarioRun) -> list[float]:
    excited = run.identifying
    at = np.array([excited.stop - 1])
    theta = solved(run.time_s[excited], run.measured_m[excited], run.pressure_pa[excited], at, PRINTED_10)
    return [float(value) for value in theta[:, 0]]


def _label(run: ScenarioRun) -> str:
    return "no noise, or 1e5 Hz (the same)" if run.noise.name == "none" else run.noise.name


def _save(figure: "Figure", path: Path) -> None:
    from matplotlib import pyplot as plt

    figure.savefig(path, dpi=DOTS_PER_INCH)
    plt.close(figure)


def _draw_estimate(
    path: Path, name: str, unit: str, true: float, curves: Sequence[tuple[ScenarioRun, "Array"]], title: str
) -> None:
    """Draw an estimate over the span of the seed's graphs, up to 0.8 s, sample by sample."""
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(8, 3.8), layout="constrained")
    for colour, (run, values) in zip(COLOURS, curves, strict=True):
        hectic = float(np.std(np.diff(values))) > 1e-3 * abs(true)
        time_s = run.time_s[run.identifying][-len(values) :]
        width, alpha, order = (0.3, 0.5, 1) if hectic else (1.4, 1.0, 3)
        axes.plot(time_s, values, color=colour, lw=width, alpha=alpha, zorder=order, label=_label(run))
    axes.axhline(true, color="black", lw=1.4, ls="--", zorder=5, label="true")
    axes.set_xlabel("time, s")
    axes.set_ylabel(f"${name}_e$, {unit}")
    axes.set_xlim(0.4, S1_FROM_S)
    axes.grid(alpha=0.3)
    axes.set_title(title, fontsize=9)
    legend = figure.legend(loc="outside upper center", ncols=4, frameon=False, fontsize=9)
    for line in legend.get_lines():
        line.set_linewidth(1.4)
    _save(figure, path)


def _draw_derivatives(path: Path, quiet: ScenarioRun, noisy: ScenarioRun) -> None:
    """Draw velocity and acceleration: the first jerk without noise, and the slow motion with the sine."""
    from matplotlib import pyplot as plt

    figure, grid = plt.subplots(2, 2, sharex="col", figsize=(10, 5.2), layout="constrained")
    columns = ((quiet, JERK_S, "first jerk, no noise"), (noisy, SLOW_S, f"slow motion, {noisy.noise.name}"))
    for column, (run, (begin_s, end_s), title) in enumerate(columns):
        rows = (run.time_s >= begin_s) & (run.time_s < end_s)
        time_ms = 1e3 * run.time_s[rows]
        true = run.true_m_per_s, np.gradient(run.true_m_per_s, run.time_s)
        n, h = fir_length(run), run.period_s
        corrected, printed = (derivatives(run, each(n, h)) for each in (corrected_filters, printed_filters))
        for row, (unit, name) in enumerate((("m/s", "velocity (19)"), ("m/s$^2$", "acceleration (21)"))):
            axes = grid[row, column]
            axes.plot(time_ms, printed[row][rows], color=COLOURS[2], lw=1.2, label="as printed: a window late")
            axes.plot(time_ms, corrected[row][rows], color=COLOURS[1], lw=1.2, label="corrected")
            axes.plot(time_ms, true[row][rows], color="black", lw=1.4, ls="--", label="true")
            axes.set_ylabel(f"{name}, {unit}")
            axes.grid(alpha=0.3)
        grid[0, column].set_title(title, fontsize=10)
        grid[1, column].set_xlabel("time, ms")
    figure.legend(
        *grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False, fontsize=9
    )
    _save(figure, path)


def _draw_tracking(path: Path, seed_tracks: Sequence[tuple[ScenarioRun, ParameterTracks]], file: ValveFile) -> None:
    """Draw stem and reference under the sine, and the errors under every noise."""
    from matplotlib import pyplot as plt

    stroke_m = file.valve.stroke_m
    figure, (above, below) = plt.subplots(
        2, 1, sharex=True, figsize=(9, 5.6), height_ratios=(3, 2), layout="constrained"
    )
    noisy, noisy_tracks = seed_tracks[1]
    _paint_states(above)
    _paint_states(below)
    in_law = noisy.time_s > S1_FROM_S
    reference = np.where(in_law, noisy.reference_m / stroke_m, np.nan)
    above.plot(noisy.time_s, noisy.measured_m / stroke_m, color="#bbbbbb", lw=0.3)
    above.plot([], [], color="#bbbbbb", lw=5, label=f"measured, {noisy.noise.name}")
    above.plot(noisy.time_s, noisy.true_m / stroke_m, color=COLOURS[1], lw=1.5, label="stem, the daemon's estimates")
    above.plot(noisy.time_s, reference, color="black", lw=1.2, ls="--", label="reference")
    law_s, law_m = by_the_seeds_law(noisy, file, seed_ratios(noisy, noisy_tracks))
    drawn = law_s > S1_FROM_S
    error = law_m[drawn] - np.interp(law_s[drawn], noisy.time_s, noisy.reference_m)
    below.fill_between(
        (S1_FROM_S, UNTIL_S),
        -LARGEST_ERROR_PU,
        LARGEST_ERROR_PU,
        color="#bbbbbb",
        alpha=0.5,
        lw=0,
        label="the seed's ±0.01",
    )
    below.plot(law_s[drawn], error / stroke_m, color=COLOURS[2], lw=1.4, label=f"last $k_e$ kept, {noisy.noise.name}")
    for i, (run, _) in enumerate(seed_tracks):
        error = (run.true_m - run.reference_m)[in_law] / stroke_m
        below.plot(run.time_s[in_law], error, color=COLOURS[1], lw=1.4, label="daemon, each noise" if i == 0 else None)
    above.set_ylim(0, 0.8)
    below.set_ylim(-0.03, 0.03)
    above.set_xlim(0, UNTIL_S)
    above.set_ylabel("position, p.u.")
    below.set_ylabel("true error, p.u.")
    below.set_xlabel("time, s")
    above.legend(loc="upper left", ncols=3, frameon=False, fontsize=9)
    below.legend(loc="upper left", frameon=False, fontsize=9)
    _save(figure, path)


def _paint_states(axes: "Axes") -> None:
    spans = (
        (State.S3_IDENTIFY, 0.0, S1_FROM_S),
        (State.S1_UP, S1_FROM_S, S2_FROM_S),
        (State.S2_DOWN, S2_FROM_S, UNTIL_S),
    )
    for state, begin_s, end_s in spans:
        axes.axvspan(begin_s, end_s, color=STATE_COLOURS[state], alpha=0.45, lw=0, zorder=0)
        axes.text((begin_s + end_s) / 2, 0.04, state.name[:2], ha="center", transform=axes.get_xaxis_transform())
    axes.grid(alpha=0.3)

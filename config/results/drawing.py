"""What the figures of all results share: colours, axes over time, intervals, and the race of the effects.

Figures come from pyplot and leave its list at once: a notebook shows one that is returned exactly once, and no figure
is left open. matplotlib is loaded here, at the first figure.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from config.extras import import_extra

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MEASURED, MODEL, BETTER, QUIET, FAINT = "#1f2a37", "#d9622b", "#1b7f79", "#5b6675", "#9aa4b1"
"""Colours: what was measured, a model, what is valid or chosen, what stands beside it, what was refused."""
WIDTH_INCHES, ROW_INCHES = 10.0, 0.26  # of a picture, and of a bar in it with its words
STEPS = ((1, 2, 5), (1, 1.5, 2, 3, 4, 5, 6, 7, 8, 9), (1, 1.2, 1.4, 1.6, 1.8, 2, 2.5, 3, 3.5, 4, 4.5, 5, 6, 7, 8, 9))
"""Where a decade has ticks, coarse to fine."""


def panels(heights: Mapping[str, float], over: str) -> "tuple[Figure, Sequence[Axes]]":
    """Return a figure with panels over one horizontal axis; their heights, inches, by what they show."""
    pyplot = import_extra("matplotlib.pyplot", "plot")
    figure, axes = pyplot.subplots(
        len(heights),
        sharex=True,
        squeeze=False,
        figsize=(WIDTH_INCHES, sum(heights.values())),
        height_ratios=list(heights.values()),
        layout="constrained",
    )
    pyplot.close(figure)
    for each, shown in zip(axes[:, 0], heights, strict=True):
        each.grid(alpha=0.3)
        each.set_ylabel(shown)
    axes[-1, 0].set_xlabel(over)
    return figure, list(axes[:, 0])


def legend(axes: "Axes") -> None:
    """Name the lines, on one row above the panel."""
    axes.legend(frameon=False, ncols=4, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)


@dataclass(frozen=True, slots=True)
class Interval:
    """A named value with the ends of its interval, as they are drawn."""

    name: str
    value: float
    low: float
    high: float
    colour: str = BETTER


def intervals(shown: Sequence[Interval], label: str) -> "tuple[Figure, Axes]":
    """Draw named values with their intervals, the first on top; what is infinite reaches the edge."""
    figure, (axes,) = panels({"": 0.9 + ROW_INCHES * len(shown)}, label)
    finite = [end for each in shown for end in (each.low, each.high) if np.isfinite(end)]
    low, high = (min(finite), max(finite)) if finite else (0.0, 1.0)
    margin = 0.1 * (high - low) or 1.0
    axes.set_xlim(low - margin, high + margin)
    for row, each in enumerate(reversed(shown)):
        ends = np.clip([each.low, each.high], low - margin, high + margin)
        axes.plot(ends, [row, row], color=each.colour, lw=2.0)
        axes.plot(each.value, row, "o", color=each.colour, ms=6.0)
    axes.set_yticks(range(len(shown)), [each.name for each in reversed(shown)])
    axes.set_ylim(-0.7, len(shown) - 0.3)
    return figure, axes


def race(errors: Mapping[str, float], chosen: Collection[str], marks: Mapping[str, float], label: str) -> "Figure":
    """Draw the errors of what was tried on a logarithmic scale, the least on top, the chosen ones in colour.

    Args:
        errors: by name; what is not finite and positive is left out.
        chosen: names drawn in colour.
        marks: vertical lines, by what they are called.
        label: of the horizontal axis.
    """
    drawn = [(name, error) for name, error in errors.items() if np.isfinite(error) and error > 0.0]
    ordered = sorted(drawn, key=lambda each: -each[1])
    names = [name for name, _ in ordered]
    figure, (axes,) = panels({"": 1.1 + ROW_INCHES * len(names)}, label)
    colours = [BETTER if name in chosen else FAINT for name in names]
    axes.scatter([error for _, error in ordered], names, color=colours, zorder=3)
    for (name, value), style in zip(marks.items(), (":", "--"), strict=False):
        axes.axvline(value, color=QUIET, ls=style, label=name)
    _logarithmic(axes, [*(error for _, error in ordered), *marks.values()])
    axes.set_ylim(-0.7, len(names) - 0.3)
    legend(axes)
    return figure


def _logarithmic(axes: "Axes", values: Sequence[float]) -> None:
    """Scale the horizontal axis to the values, with ticks in plain numbers."""
    if span := decade_ticks(values):
        low, high, shown = span
        axes.set_xscale("log")
        axes.set_xlim(low, high)
        axes.set_xticks(shown, [f"{each:g}" for each in shown])
        axes.minorticks_off()


def decade_ticks(values: Sequence[float]) -> tuple[float, float, list[float]] | None:
    """Return the ends of a logarithmic axis about values, and its ticks: at 1, 2 and 5, or finer to be three at least.

    None: no value is positive and finite.
    """
    positive = [each for each in values if 0.0 < each < np.inf]
    if not positive:
        return None
    low, high = 0.8 * min(positive), 1.25 * max(positive)
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    shown: list[float] = []
    for steps in STEPS:
        ticks = [step * 10.0**decade for decade in decades for step in steps]
        shown = [float(f"{each:.3g}") for each in ticks if low <= each <= high]
        if len(shown) > 2:
            break
    return low, high, shown


def line(axes: "Axes", x: ArrayLike, y: ArrayLike, colour: str, label: str = "", **style: Any) -> None:
    """Draw a line."""
    axes.plot(x, y, color=colour, lw=1.1, label=label or None, **style)

"""All figures of a recording, and how they show themselves: `ResponseFigures`, what `respond` returns."""

from collections.abc import Iterator
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING

from config.results.block import Block, Table
from config.results.result import Result
from positioner.response.figure import Figure
from positioner.response.measured_dead_band import follows_step
from positioner.response.step_figures import FIGURES, StepFigures

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

COLUMNS = (
    ("travel", "mm", "travel_m", 1e3),
    ("gain", "", "static_gain", 1.0),
    ("Td", "s", "dead_time_s", 1.0),
    ("T63", "s", "t63_s", 1.0),
    ("T86", "s", "t86_s", 1.0),
    ("overshoot", "%", "overshoot_percent", 1.0),
    ("error", "mm", "final_error_m", 1e3),
)
"""Heading, unit, figure, and what turns SI into the unit."""
TIMES = (("Td", "dead_time_s"), ("T63", "t63_s"), ("T86", "t86_s"))


@dataclass(frozen=True, slots=True)
class Summary:
    """One figure over all steps that determine it."""

    count: int
    smallest: float
    median: float
    largest: float


@dataclass(frozen=True, slots=True, repr=False)
class ResponseFigures(Result):
    """What a recording says of a valve's response, SI units."""

    input: str
    """The column that steps: `reference_m` or `command_pa`."""
    steps: tuple[StepFigures, ...]
    noise_m: float | None
    static_gain: Figure
    """Position over input between the outermost levels stepped to."""
    dead_band: Figure
    resolution: Figure
    notes: tuple[str, ...]

    def over_steps(self, name: str) -> Summary | None:
        """Return one of `FIGURES` over the steps that the stem responded to; None when no step determines it."""
        gain = self.static_gain.value
        asked = [each for each in self.steps if gain and follows_step(each, gain)]
        determined = [figure.value for each in asked if (figure := getattr(each, name)).value is not None]
        return Summary(len(determined), min(determined), median(determined), max(determined)) if determined else None

    @property
    def _input_unit(self) -> tuple[float, str]:
        return (1e3, "mm") if self.input == "reference_m" else (1e-3, "kPa")

    @property
    def _gain_unit(self) -> str:
        return "m/m" if self.input == "reference_m" else "m/Pa"

    def blocks(self) -> list[Block]:
        """Say the figures of each step and of all, or why there are none."""
        notes = [f"note: {note}" for note in self.notes]
        if not self.steps:
            return ["no step", *notes]
        scale, unit = self._input_unit
        noise = "" if self.noise_m is None else f", scatter at rest {1e3 * self.noise_m:.3g} mm"
        return [
            f"{len(self.steps)} steps of {self.input}{noise}",
            self._table(),
            _label_figure("static gain", self.static_gain, 1.0, self._gain_unit),
            _label_figure("dead band", self.dead_band, scale, unit),
            _label_figure("resolution", self.resolution, scale, unit),
            *self._explain_missing(),
            *notes,
        ]

    def _table(self) -> Table:
        scale, unit = self._input_unit
        headings = (
            "step",
            "time s",
            f"from {unit}",
            f"to {unit}",
            *(f"{name} {of or self._gain_unit}" for name, of, _, _ in COLUMNS),
        )
        rows = [
            (
                str(number),
                f"{step.time_s:.4g}",
                f"{scale * step.input_from:.5g}",
                f"{scale * step.input_to:.5g}",
                *(_cell(getattr(step, name), factor) for _, _, name, factor in COLUMNS),
            )
            for number, step in enumerate(self.steps, start=1)
        ]
        for which in ("smallest", "median", "largest"):
            told = [(self.over_steps(name), factor) for _, _, name, factor in COLUMNS]
            values = ("-" if each is None else f"{factor * getattr(each, which):.4g}" for each, factor in told)
            rows.append((which, "", "", "", *values))
        return Table(headings, rows)

    def _explain_missing(self) -> Iterator[str]:
        """Yield why figures are missing, each reason once, with its steps and figures."""
        reasons: dict[str, dict[str, list[int]]] = {}
        for number, step in enumerate(self.steps, start=1):
            for heading, reason in self._missing(step):
                reasons.setdefault(reason, {}).setdefault(heading, []).append(number)
        for reason, missing in reasons.items():
            steps = sorted({number for numbers in missing.values() for number in numbers})
            yield f"- {', '.join(missing)} of step {_ranges(steps)}: {reason}"

    def _missing(self, step: StepFigures) -> list[tuple[str, str]]:
        """Return what is not determined and why, but for the error of a pressure, which never is."""
        figures = [
            (heading, getattr(step, name))
            for heading, _, name, _ in COLUMNS
            if name != "final_error_m" or self.input == "reference_m"
        ]
        return [(heading, figure.reason) for heading, figure in figures if figure.reason is not None]

    def frame_columns(self) -> dict[str, list[object]]:
        """Return a row a step: its time, input, and each figure with its uncertainty, None where undetermined."""
        columns: dict[str, list[object]] = {
            name: [getattr(each, name) for each in self.steps] for name in ("time_s", "input_from", "input_to", "moved")
        }
        for name in FIGURES:
            figures: list[Figure] = [getattr(each, name) for each in self.steps]
            columns[name] = [each.value for each in figures]
            columns[f"{name}_plus_minus"] = [each.plus_minus for each in figures]
        return columns

    def plot(self) -> "Drawing":
        """Draw dead time, T63 and T86 of each step, with their uncertainties, over the size of the step."""
        from config.results.drawing import BETTER, MEASURED, MODEL, legend, panels

        scale, unit = self._input_unit
        figure, (axes,) = panels({"time, s": 4.0}, f"step of {self.input}, {unit}")
        for (label, name), colour in zip(TIMES, (MEASURED, MODEL, BETTER), strict=True):
            told = [(scale * each.size, getattr(each, name)) for each in self.steps]
            shown = [(size, time) for size, time in told if time.value is not None]
            axes.errorbar(
                [size for size, _ in shown],
                [time.value for _, time in shown],
                [time.plus_minus or 0.0 for _, time in shown],
                fmt="o",
                color=colour,
                label=label,
            )
        legend(axes)
        return figure


def _cell(figure: Figure, factor: float) -> str:
    return "-" if figure.value is None else f"{factor * figure.value:.4g}"


def _label_figure(name: str, figure: Figure, factor: float, unit: str) -> str:
    if figure.value is None:
        return f"{name:<12} cannot be determined: {figure.reason}"
    return f"{name:<12} {factor * figure.value:.4g} ± {factor * (figure.plus_minus or 0.0):.2g} {unit}"


def _ranges(numbers: list[int]) -> str:
    """Return 1, 2, 3, 7 as "1-3, 7"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)

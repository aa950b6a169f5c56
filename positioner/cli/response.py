"""`positioner response`: step-response figures by their trade names."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from positioner.cli.parts.export_arguments import add_export_arguments, read_any

if TYPE_CHECKING:
    from config.recording import Recording
    from positioner.response import Figure, ResponseFigures, StepFigures

HELP = "step-response figures of a recording by their trade names; exit status 1 if it holds no step"
EXAMPLE = "positioner response rec.csv --json figures.json"

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


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recording", type=Path, metavar="REC", help="a recording, CSV or Parquet")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write all figures, with their uncertainties, as JSON"
    )
    add_export_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the figures; 0 if there is a step, else 1."""
    import json

    from positioner.response import as_json, respond

    response = respond(_recording(arguments))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(as_json(response), allow_nan=False) + "\n", encoding="utf-8")
    print("\n".join(_lines(arguments.recording, response)))
    return 0 if response.steps else 1


def _recording(arguments: argparse.Namespace) -> "Recording":
    from config.errors import InputError
    from config.recording import Recording

    in_percent = any(":%" in each for each in arguments.column)
    if in_percent and arguments.stroke_m is None:
        raise InputError("--stroke-m", "is needed to turn a column in % into metres; give what 100 % is")
    recording = read_any(arguments.recording, arguments, arguments.stroke_m or 1.0) if arguments.column else None
    return recording or Recording.read(arguments.recording)


def _lines(path: Path, response: "ResponseFigures") -> list[str]:
    notes = [f"  note: {note}" for note in response.notes]
    if not response.steps:
        return [f"{path}: no step", *notes]
    scale, unit = (1e3, "mm") if response.input == "reference_m" else (1e-3, "kPa")
    noise = "" if response.noise_m is None else f", noise {1e3 * response.noise_m:.3g} mm"
    lines = [f"{path}: {len(response.steps)} steps of {response.input}{noise}", "", *_table(response, scale, unit), ""]
    gain_unit = "m/m" if response.input == "reference_m" else "m/Pa"
    lines += [
        _named("static gain", response.static_gain, 1.0, gain_unit),
        _named("dead band", response.dead_band, scale, unit),
        _named("resolution", response.resolution, scale, unit),
    ]
    return [*lines, *_undetermined(response), *notes]


def _table(response: "ResponseFigures", scale: float, unit: str) -> list[str]:
    head = "".join(f"{f'{name} {unit}'.strip():>13}" for name, unit, _, _ in COLUMNS)
    lines = [f"  {'step':>6}{'time s':>10}{f'from {unit}':>12}{f'to {unit}':>12}{head}"]
    for number, step in enumerate(response.steps, start=1):
        figures = "".join(f"{_cell(getattr(step, name), factor):>13}" for _, _, name, factor in COLUMNS)
        ends = f"{scale * step.input_from:>12.5g}{scale * step.input_to:>12.5g}"
        lines.append(f"  {number:>6}{step.time_s:>10.4g}{ends}{figures}")
    for which in ("smallest", "median", "largest"):
        cells = [(response.summary(name), factor) for _, _, name, factor in COLUMNS]
        values = (
            f"{'-' if determined is None else f'{factor * getattr(determined, which):.4g}':>13}"
            for determined, factor in cells
        )
        lines.append(f"  {which:<40}{''.join(values)}")
    return lines


def _cell(figure: "Figure", factor: float) -> str:
    return "-" if figure.value is None else f"{factor * figure.value:.4g}"


def _named(name: str, figure: "Figure", factor: float, unit: str) -> str:
    if figure.value is None:
        return f"  {name:<12} cannot be determined: {figure.reason}"
    return f"  {name:<12} {factor * figure.value:.4g} ± {factor * (figure.plus_minus or 0.0):.2g} {unit}"


def _undetermined(response: "ResponseFigures") -> list[str]:
    """Return why figures are missing, each reason once, with its steps and figures."""
    reasons: dict[str, dict[str, list[int]]] = {}
    for number, step in enumerate(response.steps, start=1):
        for heading, reason in _missing(step, response.input):
            reasons.setdefault(reason, {}).setdefault(heading, []).append(number)
    lines = []
    for reason, missing in reasons.items():
        steps = sorted({number for numbers in missing.values() for number in numbers})
        lines.append(f"  - {', '.join(missing)} of step {_ranges(steps)}: {reason}")
    return lines


def _missing(step: "StepFigures", input_: str) -> list[tuple[str, str]]:
    """Return what is not determined and why, but for the error of a pressure, which never is."""
    figures = [
        (heading, getattr(step, name))
        for heading, _, name, _ in COLUMNS
        if name != "final_error_m" or input_ == "reference_m"
    ]
    return [(heading, figure.reason) for heading, figure in figures if figure.reason is not None]


def _ranges(numbers: list[int]) -> str:
    """Return 1, 2, 3, 7 as "1-3, 7"."""
    runs: list[list[int]] = []
    for number in numbers:
        if runs and number == runs[-1][-1] + 1:
            runs[-1].append(number)
        else:
            runs.append([number])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)

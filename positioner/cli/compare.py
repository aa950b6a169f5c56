"""`positioner compare`: where the model stands against the measurement."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from positioner.cli.parts.export_arguments import add_export_arguments, read_any

if TYPE_CHECKING:
    from workbench import Comparison

HELP = "hold a model against a recording in free run and say where it fails; exit status 1 if it is not adequate"
EXAMPLE = "positioner compare rec.csv --valve seed --report compared.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recording", type=Path, metavar="REC", help="a recording, CSV or Parquet")
    parser.add_argument("--valve", required=True, metavar="VALVE.toml", help="a valve file, or a shipped valve's name")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers as JSON")
    parser.add_argument("--report", type=Path, metavar="FILE.html", help="write a report to be read in a browser")
    add_export_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Compare and print; 0 if the model is adequate, else 1."""
    import json

    from config.valve_file import find_valve, load_valve
    from positioner.cli.parts.naming import naming
    from workbench.compare.comparison import as_json, compare

    valve = load_valve(find_valve(arguments.valve))
    recording = read_any(arguments.recording, arguments, valve.valve.stroke_m)
    with naming({"recording": str(arguments.recording), "valve file": arguments.valve}):
        compared = compare(recording, valve)
    print("\n".join(_lines(arguments, compared)))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(as_json(compared), allow_nan=False) + "\n", encoding="utf-8")
    if arguments.report is not None:
        from workbench.report import Subject, report_comparison

        subject = Subject(valve, (str(arguments.recording),), recording.metadata)
        report_comparison(compared, arguments.report, subject)
    return 0 if compared.adequate else 1


def _lines(arguments: argparse.Namespace, compared: "Comparison") -> list[str]:
    from workbench.compare.comparison_sentences import shortened

    verdict = "adequate" if compared.adequate else "not adequate"
    repeated = "" if compared.repeatability_m is None else f", repeatability {_mm(compared.repeatability_m)}"
    lines = [
        f"{arguments.valve} against {arguments.recording}: {verdict}",
        *(f"  {sentence}" for sentence in compared.sentences),
        "",
        f"  fit {compared.fit_percent:.2f} %, error {_mm(compared.rms_m)} rms, {_mm(compared.robust_m)} robust, "
        f"noise {_mm(compared.noise_m)}{repeated}",
        "",
        f"  {'phase':<15}{'samples':>9}{'rms mm':>11}{'mean mm':>11}{'share':>8}",
    ]
    for each in compared.phases:
        if each.count:
            lines.append(
                f"  {each.name:<15}{each.count:>9}{1e3 * each.rms_m:>11.4f}{1e3 * each.mean_m:>11.4f}{each.share:>8.0%}"
            )
    slips = compared.slips
    lines += [
        "",
        f"  slips: {len(slips.matched)} matched, {len(slips.missed_s)} missed, {len(slips.spurious_s)} spurious",
        f"  residual: {compared.autocorrelation.outside} of {len(compared.autocorrelation.lag) - 1} lags outside the "
        f"99 % band; with the command: {compared.input_correlation.outside} of {len(compared.input_correlation.lag)}",
    ]
    side = compared.pressure_side
    if side is not None:
        lines.append(
            f"  measured pressure: the model's is off by {side.pressure_rms_pa:.4g} Pa rms; run from the measured one, "
            f"the error is {_mm(side.stem_rms_m)} rms"
        )
    return lines + [f"  recording: {note}" for note in shortened(compared.notes)]


def _mm(value_m: float) -> str:
    return f"{1e3 * value_m:.4g} mm"

"""`positioner compare`: where the model stands against the measurement."""

import argparse
from pathlib import Path

from config.file_kinds import VALVE_SAID
from positioner.cli.parts.fit_arguments import add_noise_and_exports, read_with_noise
from positioner.cli.parts.given_names import naming
from positioner.cli.parts.model_arguments import read_valve
from positioner.cli.parts.output_files import write_json
from positioner.cli.parts.progress import at_work

HELP = "simulate a recording and print where the model fails; exit status 1 if it is not adequate"
EXAMPLE = "positioner compare rec.csv --valve seed --report compared.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recording", type=Path, metavar="REC", help="a recording, CSV or Parquet")
    parser.add_argument("--valve", required=True, metavar="VALVE.toml", help=VALVE_SAID)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers as JSON")
    parser.add_argument("--report", type=Path, metavar="FILE.html", help="write a report for a browser")
    add_noise_and_exports(parser)


def run(arguments: argparse.Namespace) -> int:
    """Compare and print; 0 if the model is adequate, else 1."""
    from workbench.compare.comparison import compare

    valve = read_valve(arguments.valve)
    recording = read_with_noise(arguments.recording, arguments, valve)
    named = {"recording": str(arguments.recording), "valve file": arguments.valve}
    with naming(named), at_work("compare", f"holding {arguments.valve} against {arguments.recording}"):
        compared = compare(recording, valve)
    print(f"{arguments.valve} against {arguments.recording}: {compared.summary()}")
    write_json(arguments.json, compared)
    if arguments.report is not None:
        from workbench.report import Subject, report_comparison

        subject = Subject(valve, (str(arguments.recording),), recording.metadata)
        report_comparison(compared, arguments.report, subject)
    return 0 if compared.adequate else 1

"""`positioner response`: step-response figures by their trade names."""

import argparse
from pathlib import Path

from positioner.cli.parts.export_arguments import add_export_arguments, read_any
from positioner.cli.parts.output_files import write_json
from positioner.cli.parts.progress import at_work

HELP = "print dead time, T63, T86, dead band and so on of a recording; exit status 1 if it holds no step"
EXAMPLE = "positioner response rec.csv --json figures.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recording", type=Path, metavar="REC", help="a recording, CSV or Parquet")
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write all figures, with their uncertainties, as JSON"
    )
    add_export_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the figures; 0 if there is a step, else 1."""

    from positioner.response import as_json, respond

    recording = read_any(arguments.recording, arguments, None)
    with at_work("response", f"finding the steps of {len(recording)} samples"):
        response = respond(recording)
    write_json(arguments.json, as_json(response))
    print(f"{arguments.recording}: {response.summary()}")
    return 0 if response.steps else 1

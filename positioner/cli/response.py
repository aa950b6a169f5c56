"""`positioner response`: step-response figures by their trade names."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from positioner.cli.parts.export_arguments import add_export_arguments, read_any
from positioner.cli.parts.output_files import write_json

if TYPE_CHECKING:
    from config.recording import Recording

HELP = "step-response figures of a recording by their trade names; exit status 1 if it holds no step"
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

    response = respond(_recording(arguments))
    if arguments.json is not None:
        write_json(arguments.json, as_json(response))
    print(f"{arguments.recording}: {response.summary()}")
    return 0 if response.steps else 1


def _recording(arguments: argparse.Namespace) -> "Recording":
    from config.errors import InputError
    from config.recording import Recording

    in_percent = any(":%" in each for each in arguments.column)
    if in_percent and arguments.stroke_m is None:
        raise InputError("--stroke-m", "is needed to turn a column in % into metres; give what 100 % is")
    recording = read_any(arguments.recording, arguments, arguments.stroke_m or 1.0) if arguments.column else None
    return recording or Recording.read(arguments.recording)

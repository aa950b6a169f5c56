"""`positioner workbench`: the workbench as a page in a browser."""

import argparse
from pathlib import Path

from config.file_kinds import VALVE_SAID
from webpage.listening_arguments import add_page, listening

HELP = "open the workbench in a browser: compare, diagnose, add what is missing"
EXAMPLE = "positioner workbench rec.csv --valve seed"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recordings", type=Path, nargs="*", metavar="REC", help="recordings, or folders with some")
    parser.add_argument("--valve", metavar="VALVE.toml", help=VALVE_SAID)
    add_page(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve until told to end; 0."""
    from workbench.page.page import serve_workbench

    serve_workbench(arguments.recordings, arguments.valve, listening(arguments), opens_browser=not arguments.no_open)
    return 0

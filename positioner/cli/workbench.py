"""`positioner workbench`: the workbench as a page in a browser."""

import argparse
from pathlib import Path

HELP = "open the workbench in a browser: drop a recording, drag parameters, diagnose, add what is missing"
EXAMPLE = "positioner workbench rec.csv --valve seed"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recordings", type=Path, nargs="*", metavar="REC", help="recordings, or folders with some")
    parser.add_argument("--valve", metavar="VALVE.toml", help="a valve file, or a shipped valve's name")
    parser.add_argument("--host", default="127.0.0.1", help="where it listens (127.0.0.1: this machine alone)")
    parser.add_argument("--port", type=int, metavar="N", help="at which port (8765, or another free one)")
    parser.add_argument(
        "--password-file", type=Path, metavar="FILE", help="its first line is asked of everybody; other hosts need it"
    )
    parser.add_argument("--no-open", action="store_true", help="print the address, open no browser")


def run(arguments: argparse.Namespace) -> int:
    """Serve until told to end; 0."""
    from positioner.cli.parts.page_address import listening
    from positioner.pages.workbench_page.page import serve_workbench

    serve_workbench(arguments.recordings, arguments.valve, listening(arguments), opens_browser=not arguments.no_open)
    return 0

"""`positioner reproduce`: the paper's figures and claims, as printed, corrected, and under honest noise.

In a clone of the project alone: `benchmarks/paper` prints them.
"""

import argparse
from pathlib import Path

from config.errors import InputError
from positioner.cli.parts.clone_only import benchmark
from positioner.cli.parts.output_files import make_folder

HELP = "print figures and claims of the paper behind this project, in two minutes; only in a clone of the project"
EXAMPLE = "positioner reproduce --out figures --json reproduced.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("--out", type=Path, metavar="DIR", help="draw the figures there")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the numbers as JSON")
    parser.add_argument("--seeds", type=int, default=100, help="runs per cell of the noise table")


def run(arguments: argparse.Namespace) -> int:
    """Run it; exit status 1 when a claim does not hold without noise, or a printed form is no worse than ours."""

    if arguments.seeds < 2:
        raise InputError("--seeds", f"must be at least 2, it is {arguments.seeds}")
    if arguments.out:
        make_folder(arguments.out)
    status: int = benchmark("paper", "reproduce").reproduced(arguments.out, arguments.json, arguments.seeds)
    return status

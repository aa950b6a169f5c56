"""`positioner loops`: the loops of a plant, ranked by what their valves' friction costs."""

import argparse
import sys
from pathlib import Path

from config.errors import InputError
from config.results.block import as_text
from positioner.cli.parts.loop_arguments import add_notation_arguments, notation
from positioner.cli.parts.output_files import write_json

HELP = "rank the loops of a plant from OP, PV and SP alone; exit status 1 if any valve sticks"
EXAMPLE = "positioner loops plant.csv --report plant.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("manifest", type=Path, metavar="MANIFEST", help="CSV: loop, file, and time, op, pv, sp, mode")
    parser.add_argument(
        "--out", type=Path, metavar="FOLDER", help="folder of results; a later run examines only what is new"
    )
    parser.add_argument("--workers", type=int, metavar="N", help="number of processes (one a core)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the result as JSON")
    parser.add_argument("--report", type=Path, metavar="FILE.html", help="write the ranking for a browser")
    add_notation_arguments(parser.add_argument_group("columns", "of all files; names stand in the manifest"))


def run(arguments: argparse.Namespace) -> int:
    """Print the ranking; 1 if any valve sticks, 2 if no loop can be read, else 0."""
    from workbench.loops.loop_report import report_loops
    from workbench.loops.plant import diagnose_plant, read_manifest

    if arguments.workers is not None and arguments.workers < 1:
        raise InputError("--workers", f"must be 1 or more, got {arguments.workers}")
    entries = read_manifest(arguments.manifest)
    plant = diagnose_plant(
        entries,
        arguments.workers,
        lambda each: print(each.sentence, file=sys.stderr, flush=True),
        arguments.out,
        notation(arguments),
    )
    write_json(arguments.json, [each.as_json() for each in plant.ranked])
    if arguments.report is not None:
        report_loops(plant, arguments.report, arguments.manifest.name)
    print(as_text([plant.ranking]))
    for group in plant.groups:
        print(
            f"{', '.join(group.loops)} oscillate together, period {group.period_s:.4g} s; "
            f"likeliest source {group.source}: {group.because}"
        )
    for name, why in plant.unreadable:
        print(f"{name}: {why}", file=sys.stderr)
    return 2 if not plant.ranked else 1 if plant.count("sticks") else 0

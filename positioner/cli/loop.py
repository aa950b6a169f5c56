"""`positioner loop`: does the valve of a control loop stick, from OP, PV and SP alone."""

import argparse
from dataclasses import asdict
from pathlib import Path

from positioner.cli.parts.loop_arguments import add_loop_arguments, read_record
from positioner.cli.parts.output_files import write_json
from positioner.cli.parts.progress import at_work

HELP = "tell from OP, PV and SP alone whether a valve sticks; exit status 1 if it sticks or is undecided"
EXAMPLE = "positioner loop FIC101.csv --report loop.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recording", type=Path, nargs="+", metavar="REC", help="a historian's export: time, OP, PV, SP")
    parser.add_argument("--together", action="store_true", help="all files are of one valve: add their evidence")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the result as JSON")
    parser.add_argument("--report", type=Path, metavar="FILE.html", help="write a report for a browser")
    add_loop_arguments(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the verdict of each loop; 0 if every valve is without fault, else 1."""

    from workbench.loops import diagnose_loop
    from workbench.loops.joint import together
    from workbench.loops.loop_report import report_loop

    found = []
    for path in arguments.recording:
        record = read_record(path, arguments)
        with at_work("loop", f"holding causes against each other on {record.pv.size} samples"):
            found.append(diagnose_loop(record))
        print(found[-1].summary())
    joint = together(found) if arguments.together else None
    if joint is not None:
        print(joint.sentence)
    if arguments.json is not None:
        more = [] if joint is None else [{"together": True, **asdict(joint), "sentence": joint.sentence}]
        write_json(arguments.json, [*(each.as_json() for each in found), *more])
    if arguments.report is not None:
        report_loop(found, arguments.report)
    return 0 if all(each.verdict == "something else" for each in found) else 1

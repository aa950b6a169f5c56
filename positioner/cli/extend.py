"""`positioner extend`: adds effects to a valve file, refits, says how the error fell."""

import argparse
import time
from pathlib import Path

from config.file_kinds import VALVE_SAID
from positioner.cli.parts.fit_arguments import add_noise_and_exports, add_pressure, add_test, read_fitted
from positioner.cli.parts.given_names import files_named, naming
from positioner.cli.parts.model_arguments import read_valve, require_effects
from positioner.cli.parts.output_files import writable, write_json
from positioner.cli.parts.progress import at_work

HELP = "add effects to a valve file, fit the valve, and print the error before and after"
EXAMPLE = "positioner extend seed --effect backlash --fit rec.csv -o new.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("valve", metavar="VALVE.toml", help=VALVE_SAID)
    parser.add_argument(
        "--effect",
        nargs="+",
        default=[],
        metavar="NAME",
        help="effects to add, or .py files of your own (none: fit the valve as it is)",
    )
    parser.add_argument("--fit", type=Path, nargs="+", required=True, metavar="REC", help="one or several recordings")
    add_test(parser)
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="NEW.toml", help="the new valve file")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers as JSON")
    parser.add_argument("--report", type=Path, metavar="FILE.html", help="write the journal for a browser")
    add_pressure(parser)
    add_noise_and_exports(parser)


def run(arguments: argparse.Namespace) -> int:
    """Extend and write the new file with its journal; 0 if the held-out error falls, else 1."""

    from config.valve_file import find_valve
    from workbench.diagnosis.extension import extend
    from workbench.diagnosis.extension_journal import Journal, write_extended
    from workbench.diagnosis.extension_json import as_json
    from workbench.report import report_journal

    writable(arguments.out, "-o")
    began_s = time.monotonic()
    path = find_valve(arguments.valve)
    valve = read_valve(arguments.valve)
    require_effects(arguments.effect, "--effect")
    recordings, test = read_fitted(arguments.fit, arguments, valve)
    Journal.beside(path)  # what is none is refused before the work begins
    named = files_named(arguments.fit, arguments.test, arguments.valve)
    with naming(named), at_work("extend") as progress:
        extension = extend(
            recordings,
            valve,
            arguments.effect,
            test=test,
            progress=progress,
            from_pressure=arguments.from_pressure,
        )
    journal = write_extended(extension, path, arguments.out)
    print(extension.summary())
    worth = "" if extension.falls else "written, though the error falls by no more than chance may: "
    print(f"{arguments.out}: {worth}{journal.steps[-1].why}")
    if arguments.json is not None:
        whole = as_json(extension) | {"valve": str(arguments.out), "seconds": time.monotonic() - began_s}
        write_json(arguments.json, whole)
    if arguments.report is not None:
        report_journal(journal, arguments.report, extension.valve.valve.name, extension.valve.valve.own)
    return 0 if extension.falls else 1

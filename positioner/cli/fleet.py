"""`positioner fleet`: many valves ranked by what their recordings say of them."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import InputError

if TYPE_CHECKING:
    from workbench.fleet.examination import Examination
    from workbench.fleet.manifest import Entry

HELP = "rank many valves by their recordings; exit status 1 if a valve needs attention or could not be examined"
EXAMPLE = "positioner fleet plant.csv --out fleet-out --report fleet.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("manifest", type=Path, metavar="MANIFEST", help="CSV or TOML: valve, file, recording, when")
    parser.add_argument(
        "--out", type=Path, default=Path("fleet-out"), metavar="FOLDER", help="folder of examinations and tables"
    )
    parser.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="a Dask scheduler (this machine)")
    parser.add_argument("--workers", type=int, metavar="N", help="number of processes (one a core)")
    parser.add_argument("--time-limit-s", type=float, default=900.0, metavar="S", help="time limit of one recording")
    parser.add_argument("--report", type=Path, metavar="FILE.html", help="write the ranking for a browser")
    parser.add_argument(
        "--diagnoses",
        type=int,
        default=10,
        metavar="N",
        help="number of valves with a diagnosis report, the gravest first",
    )
    parser.add_argument("--since", metavar="DATE", help="print what changed since that day")
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="with --since: draw it")


def run(arguments: argparse.Namespace) -> int:
    """Examine what was not examined before, write the tables, print the ranking."""
    from workbench.fleet.drill_down import write_diagnosis_reports
    from workbench.fleet.fleet import at, fleet
    from workbench.fleet.fleet_report import report_fleet
    from workbench.fleet.tables import write_tables

    if arguments.picture is not None and arguments.since is None:
        raise InputError("--picture", "draws what changed since a date: give it as --since DATE")
    if arguments.diagnoses < 0:
        raise InputError("--diagnoses", f"must be 0 or more, got {arguments.diagnoses}")
    since = at(arguments.since, "--since") if arguments.since else None
    if arguments.workers is not None and arguments.workers < 1:
        raise InputError("--workers", f"must be 1 or more, got {arguments.workers}")
    if not arguments.time_limit_s > 0.0:
        raise InputError("--time-limit-s", f"must be above 0, got {arguments.time_limit_s:g}")
    found = fleet(
        arguments.manifest,
        arguments.out,
        scheduler=arguments.scheduler,
        workers=arguments.workers,
        time_limit_s=arguments.time_limit_s,
        told=_tell,
    )
    write_tables(found.courses, arguments.out)
    if arguments.report is not None:
        reports = write_diagnosis_reports(found, arguments.out, arguments.diagnoses)
        report_fleet(found, arguments.report, arguments.manifest.name, reports)
    print(found.summary())
    if since is not None:
        changes = found.changed_since(since)
        print(changes.summary())
        if arguments.picture is not None:
            changes.plot().savefig(arguments.picture, dpi=120)
    return 1 if found.complaining or found.unknown else 0


def _tell(valve: str, entry: "Entry", found: "Examination") -> None:
    """Say at once what came of a recording, on standard error, where anything is to be said."""
    if found.outcome != "as_before":
        print(f"{valve}: {entry.recording}: {found.sentence}", file=sys.stderr, flush=True)

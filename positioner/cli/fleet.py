"""`positioner fleet`: many valves ranked by what their recordings say of them."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workbench.fleet.examination import Examination
    from workbench.fleet.manifest import Entry

HELP = "rank many valves by their recordings; exit status 1 if any deserves a look"
EXAMPLE = "positioner fleet plant.csv --out fleet-out --report fleet.html"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("manifest", type=Path, metavar="MANIFEST", help="CSV or TOML: valve, file, recording, when")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("fleet-out"),
        metavar="FOLDER",
        help="what was examined, and tables (fleet-out)",
    )
    parser.add_argument("--scheduler", metavar="tcp://HOST:PORT", help="a Dask scheduler (workers of this machine)")
    parser.add_argument("--workers", type=int, metavar="N", help="how many of these (one a core)")
    parser.add_argument("--report", type=Path, metavar="FILE.html", help="write the ranking as a page")
    parser.add_argument("--since", metavar="DATE", help="say what changed of the valves since then")


def run(arguments: argparse.Namespace) -> int:
    """Examine what was not examined before, write the tables, print the ranking."""
    from config.errors import InputError
    from config.results.block import as_text
    from positioner.cli.parts.output_files import writable
    from workbench.fleet.fleet import at, fleet
    from workbench.fleet.fleet_report import report_fleet
    from workbench.fleet.model_changes import changed_since, changes_told
    from workbench.fleet.tables import write_tables

    writable(arguments.report, "--report")
    since = at(arguments.since) if arguments.since else None
    if arguments.workers is not None and arguments.workers < 1:
        raise InputError("--workers", f"must be 1 or more, got {arguments.workers}")
    found = fleet(
        arguments.manifest, arguments.out, scheduler=arguments.scheduler, workers=arguments.workers, told=_tell
    )
    write_tables(found.courses, arguments.out)
    if arguments.report is not None:
        report_fleet(found, arguments.report, arguments.manifest.name)
    print(found.summary())
    if since is not None:
        print(as_text(changes_told(changed_since(found.courses, since), since)))
    return 1 if found.complaining else 0


def _tell(valve: str, entry: "Entry", found: "Examination") -> None:
    """Say at once what came of a recording, on standard error, where anything is to be said."""
    if found.outcome != "as_before":
        print(f"{valve}: {entry.recording}: {found.sentence}", file=sys.stderr, flush=True)

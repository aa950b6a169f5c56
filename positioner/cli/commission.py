"""`positioner commission`: from an I/P and a position reading alone to a file with which the daemon runs."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config.errors import InputError
from config.file_kinds import require_kind
from config.toml_editing import with_values
from config.whole_file import replace_whole
from positioner.cli.parts.breaking_off import end_as_by_ctrl_c
from positioner.cli.parts.config_argument import add_config, config_file
from positioner.cli.parts.output_files import write_json
from positioner.cli.parts.own_valve import own_valve, unknown_travel
from positioner.cli.parts.valve_test import KINDS, kept

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile
    from positioner.tests_on_the_valve.commissioning import Proposal

HELP = "find stroke, action and law of a valve, ask, and write the daemon's file (moves the valve from end to end)"
EXAMPLE = "positioner commission site.toml"

WARNING = (
    "The valve will go from end to end, several times, for four to five minutes. Whatever it controls must bear that: "
    "isolate it first."
)
NOT_THERE = (
    "is not there: write it, with [valve] name, [device] host, port and unit, and [pressure] maximum_pa, as in "
    "config/profiles/daemon.toml"
)
STROKE_UNKNOWN_M = 1.0
"""Stands in a file that says no stroke yet, until one is found."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(
        parser,
        text="the daemon's file, without [valve] stroke_m if it is not known; stop the daemon first",
    )
    parser.add_argument("--valve", dest="name", metavar="NAME", help="the valve's name, where the file has several")
    parser.add_argument("--yes", action="store_true", help="move the valve and write the result without a question")
    parser.add_argument("--keep", choices=KINDS, help="keep the result under this name")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write verdict, figures and proposals as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Commission, print, ask, write; 0 if it came to a file, else 1."""
    from positioner.control.settings import Settings
    from positioner.tests_on_the_valve.commissioning import commission

    path = arguments.config = config_file(arguments)
    file = _file(path, arguments.name)
    print(WARNING)
    if not _agreed("move it", arguments):
        print("nothing was moved")
        return 1
    stranger = unknown_travel(file)
    with end_as_by_ctrl_c(), own_valve(stranger, path) as valve:
        bounds = Settings.of(stranger).experiment
        found = commission(valve, file.valve.name, bounds, lambda said: print(f"  {said}", file=sys.stderr, flush=True))
    print(found.outcome.summary())
    write_json(arguments.json, found.outcome.as_json() | {"proposals": list(found.proposals)}, indent=1)
    if arguments.keep is not None or not found.outcome.passed:
        kept(found.outcome, file, arguments, arguments.keep or "")
    if not found.proposals:
        return 1
    return write_proposals(path, file, found.proposals, arguments)


def _file(path: Path, name: str | None) -> "DaemonFile":
    """Return the file, which may lack the stroke.

    Raises:
        InputError: there is none, which says what to write; as `load_daemon`, or it has several valves.
    """
    from config.daemon_file import DaemonFile, load_daemon
    from config.loading import read_toml, validate

    if not path.exists():
        raise InputError(str(path), NOT_THERE)
    tables: dict[str, Any] = read_toml(path)
    if isinstance(tables.get("valve"), list):
        load_daemon(path, name)
        raise InputError(str(path), "valve: several of them; commission each by a file of its own")
    valve = dict(tables.get("valve") or {})
    if valve.keys() & {"stroke_m", "travel_deg"}:
        return load_daemon(path, name)
    require_kind(tables | {"valve": valve | {"stroke_m": STROKE_UNKNOWN_M}}, "daemon", str(path))
    whole = {key: table for key, table in tables.items() if key != "law"}
    return validate(DaemonFile, whole | {"valve": valve | {"stroke_m": STROKE_UNKNOWN_M}}, str(path), path.parent)


def write_proposals(
    path: Path, file: "DaemonFile", proposals: "tuple[Proposal, ...]", arguments: argparse.Namespace
) -> int:
    """Show what is proposed, ask, and write it; 0 if it was written."""
    from config.daemon_file import load_daemon

    stays = {}
    if file.law is not None and file.law.valve is not None:
        stays["law"] = "[law] stays: it names a valve file"
    if "maximum_pa" in file.pressure.model_fields_set:
        stays["pressure"] = f"pressure.maximum_pa = {file.pressure.maximum_pa:.6g} is kept as the file gives it"
    told = [each for each in proposals if each.table not in stays]
    print(f"\nfor {path}:")
    for line in (*(each.line for each in told), *stays.values()):
        print(f"  {line}")
    before = path.read_text(encoding="utf-8")
    after = with_values(before, {(each.table, each.key): each.value for each in told}, str(path))
    if not _agreed(f"write these into {path}", arguments):
        print("nothing was written")
        return 1
    try:
        replace_whole(path, after)
        load_daemon(path, arguments.name)
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror}") from None
    except InputError as error:
        replace_whole(path, before)
        raise InputError(str(path), f"is unchanged: with what was found it would be refused: {error}") from None
    print(f"written; next: positioner doctor {path}, positioner run {path}")
    return 0


def _agreed(what: str, arguments: argparse.Namespace) -> bool:
    """Ask, unless --yes has answered; where nobody is there to answer, it is no."""
    if arguments.yes:
        return True
    try:
        return input(f"{what}? [y/N] ").strip().lower() in ("y", "yes")
    except EOFError:
        print()
        return False

"""`positioner discover`: the form of an effect that nobody has written down."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import InputError
from config.file_kinds import VALVE_SAID
from positioner.cli.parts.fit_arguments import add_noise_and_exports, add_pressure, add_test, read_fitted
from positioner.cli.parts.given_names import files_named, naming
from positioner.cli.parts.model_arguments import read_valve
from positioner.cli.parts.next_step import extend_command
from positioner.cli.parts.output_files import writable, write_json, write_text
from positioner.cli.parts.progress import at_work

if TYPE_CHECKING:
    from workbench.discover.discovery import Discovery

HELP = "find a formula for what no known effect explains; exit status 1 if there is none"
EXAMPLE = "positioner discover rec.csv --valve valve.toml --test other.csv -o found.py --picture found.png"

SHOWN_FORMS = 5  # forms that are printed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recordings", type=Path, nargs="+", metavar="REC", help="recordings, CSV or Parquet")
    parser.add_argument("--valve", required=True, metavar="VALVE.toml", help=VALVE_SAID)
    add_test(parser)
    parser.add_argument(
        "-o", "--out", type=Path, metavar="FORM.py", help="write the formula as an effect's file, for `extend`"
    )
    parser.add_argument("--picture", type=Path, metavar="FILE.png", help="draw the formula over its variable")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers as JSON")
    add_pressure(parser)
    add_noise_and_exports(parser)


def run(arguments: argparse.Namespace) -> int:
    """Discover and print; 0 if a form explains the recordings, or nothing is left to explain, else 1."""
    from workbench.discover.discovery import discover
    from workbench.discover.discovery_json import as_json

    _require_new(arguments.out)
    valve = read_valve(arguments.valve)
    recordings, test = read_fitted(arguments.recordings, arguments, valve)
    named = files_named(arguments.recordings, arguments.test, arguments.valve)
    with naming(named), at_work("discover") as progress:
        found = discover(
            recordings,
            valve,
            test=test,
            from_pressure=arguments.from_pressure,
            on_proposal=_tell_proposal,
            progress=progress,
        )
    print(found.summary())
    if arguments.out is not None:
        _write_form(found, arguments)
    if arguments.picture is not None and found.outcome not in {"explained", "unjudged"}:
        found.plot().savefig(arguments.picture, dpi=120)
        print(f"{arguments.picture}: what it adds, and what the landings miss")
    write_json(arguments.json, as_json(found))
    return 1 if found.outcome in {"none", "unjudged"} else 0


def _require_new(path: Path | None) -> None:
    """Check that a form can be written where `-o` says, and that nobody's file is there.

    Raises:
        InputError: it cannot, the file is there already, or its name is none that an effect can have.
    """

    writable(path, "-o")
    if path is None:
        return
    if path.exists():
        raise InputError(f"-o {path}", "is there already; an effect's file is not written over: choose another name")
    if path.suffix != ".py" or not path.stem.isidentifier():
        raise InputError(
            f"-o {path}", "must end in .py and be letters, digits and _ before that: the file's name is the effect's"
        )


def _tell_proposal(names: tuple[str, ...]) -> None:
    print(f"forms by projection, not a verdict: {', '.join(names[:SHOWN_FORMS])}", flush=True)


def _write_form(found: "Discovery", arguments: argparse.Namespace) -> None:
    """Write the best form, and say how it is added; say so where there is none."""

    if not found.found:
        print(f"{arguments.out}: not written: {found.sentence}")
        return
    source = ", ".join(path.name for path in arguments.recordings)
    write_text(arguments.out, found.found[0].text(source), "-o")
    name = str(arguments.out) if arguments.out.is_absolute() else f"./{arguments.out}"
    print(f"{arguments.out}: {found.found[0].form.words}: a form, not a cause")
    print(f"to add it: {extend_command([name], arguments)}")

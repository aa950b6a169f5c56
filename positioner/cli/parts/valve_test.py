"""What the commands of tests on the valve share: their options, the running valve, what becomes of an outcome."""

import argparse
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from config.codes import ExperimentState, ValveTestVerdict
from config.drive import Kind, as_written
from config.errors import CommandFailed, InputError
from config.results.block import as_text
from positioner.cli.parts.breaking_off import end_as_by_ctrl_c
from positioner.cli.parts.config_argument import add_config, config_files
from positioner.cli.parts.daemon_address import add_tls
from positioner.cli.parts.output_files import write_json

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile
    from config.experiment_limits import ExperimentLimits
    from config.recording import Recording
    from positioner.tests_on_the_valve.kept_records import Record
    from positioner.tests_on_the_valve.outcome import Outcome
    from positioner.tests_on_the_valve.program import Played, Player, Program

KINDS = ("factory", "as_found", "as_left")
"""As `positioner.tests_on_the_valve.kept_records.KINDS`, which is not loaded for `--help`."""
WINDOW_NEEDED = "experiment.travel_window: a {} goes over the whole travel, allowed is [0, 1], got [{:g}, {:g}]"


LEFT_WITH = {
    ExperimentState.FAULT: "the action of the fault commands the valve",
    ExperimentState.NOT_AUTOMATIC: "the command before is held",
}
"""What has the valve after a test that did not come to its end, where that is not the law."""


def add_test_arguments(parser: argparse.ArgumentParser, *, recordings: bool = True) -> None:
    """Declare the options of every test."""
    add_config(parser, text="the running daemon's file, with [recorder]")
    parser.add_argument("--valve", dest="name", metavar="NAME", help="the valve's name, where the file has several")
    if recordings:
        parser.add_argument(
            "--rec", type=Path, nargs="+", metavar="REC", help="evaluate these recordings of such a test; nothing moves"
        )
        parser.add_argument(
            "--stroke-m", type=float, metavar="M", help="stroke, where --rec is given without CONFIG.toml"
        )
    parser.add_argument("--area-m2", type=float, metavar="M2", help="area of the diaphragm; prints forces in N, too")
    parser.add_argument(
        "--torque-nm-per-pa",
        type=float,
        metavar="NM_PER_PA",
        help="torque per pressure of a rotary actuator; prints torques in N m, too",
    )
    parser.add_argument("--keep", choices=KINDS, help="keep the result under this name")
    parser.add_argument("--against", choices=KINDS, help="compare with the newest result of this name")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write verdict and figures as JSON")
    parser.add_argument("--picture", type=Path, metavar="FILE", help="draw it: .png, .svg or .pdf")
    add_tls(parser, ", with a certificate of role engineer")


def checked(arguments: argparse.Namespace) -> "DaemonFile | None":
    """Return the daemon's file, None where recordings are given without one; options that cannot be are refused.

    Raises:
        InputError: no file where one is needed, a number that cannot be, an output that cannot be written.
    """
    from config.daemon_file import load_daemon

    for option in ("area_m2", "torque_nm_per_pa", "stroke_m"):
        value = getattr(arguments, option, None)
        if value is not None and not 0.0 < value < 1e6:
            raise InputError(f"--{option.replace('_', '-')}", f"allowed is a positive number, got {value:g}")
    given = config_files(arguments)
    if len(given) > 1 or (not given and not getattr(arguments, "rec", None)):
        raise InputError("CONFIG.toml", f"one file is needed, got {len(given) or 'none'}")
    if given:
        arguments.config = given[0]
        file = load_daemon(given[0], arguments.name)
        turns = file.valve.kind.turns
        if (arguments.area_m2 if turns else arguments.torque_nm_per_pa) is not None:
            wrong, right = ("--area-m2", "--torque-nm-per-pa")[:: 1 if turns else -1]
            raise InputError(wrong, f"{file.valve.name} {'turns' if turns else 'has a stem'}: allowed is {right}")
        arguments.area_m2 = arguments.torque_nm_per_pa or arguments.area_m2
        return file
    if arguments.stroke_m is None:
        raise InputError("--stroke-m", "is required with --rec where no CONFIG.toml says the stroke")
    if arguments.keep or arguments.against:
        raise InputError("CONFIG.toml", "is required by --keep and --against: it says where records are kept")
    return None


def bounds_of(file: "DaemonFile") -> "ExperimentLimits":
    """Return what programs must stay inside: what the daemon permits, less its way to the first command."""
    from positioner.control.settings import Settings

    return Settings.of(file).experiment


def require_whole_travel(file: "DaemonFile", test: str, config: Path) -> None:
    """Refuse a test over the whole travel where the window keeps the stem off its ends.

    Raises:
        InputError: says what to write.
    """
    low, high = file.experiment.travel_window
    if low > 0.0 or high < 1.0:
        raise InputError(str(config), WINDOW_NEEDED.format(test, low, high))


def played_all(player: "Player", programs: "Iterable[Program]", count: int) -> "list[Played]":
    """Play so many programs, each made when it begins, until one does not come to its end; say what goes on."""
    played = []
    for number, program in enumerate(programs, start=1):
        print(f"{number} of {count}: {program.name}, {program.lasts_s:.0f} s", file=sys.stderr, flush=True)
        played.append(player.play(program))
        if not played[-1].state.played:
            break
    return played


@contextmanager
def playing(test: str, file: "DaemonFile", arguments: argparse.Namespace) -> Iterator[None]:
    """Keep a record of a test that is broken off by Ctrl-C, by what ends a command, or by a daemon that is gone.

    Raises:
        KeyboardInterrupt, CommandFailed: what broke it off.
    """
    from positioner.tests_on_the_valve.outcome import Outcome

    with end_as_by_ctrl_c():
        try:
            yield
        except (KeyboardInterrupt, CommandFailed) as error:
            why = str(error) or "by Ctrl-C, or what ended this command"
            kept(Outcome(test, file.valve.name, (), (ValveTestVerdict.BROKEN_OFF,), (why,)), file, arguments, "")
            raise


def reference_of(test: str, file: "DaemonFile", arguments: argparse.Namespace) -> "Record | None":
    """Return the record that a test is compared with; None without one.

    Raises:
        InputError: one was asked for, and there is none.
    """
    from positioner.history.kept_tests import records_folder
    from positioner.tests_on_the_valve.kept_records import baseline

    return baseline(records_folder(file, arguments.config), test, arguments.against)


def trend_of(test: str, names: Sequence[str], file: "DaemonFile", arguments: argparse.Namespace) -> str:
    """Return the last tests of this kind as text, a row each."""
    from positioner.history.kept_tests import records_folder
    from positioner.tests_on_the_valve.kept_records import records, trend

    return "\n" + as_text([trend(records(records_folder(file, arguments.config), test), names)])


def recordings_of(played: "list[Played]") -> "list[Recording]":
    """Return the recordings of what was played to its end.

    Raises:
        CommandFailed: something was broken off; says by what.
    """
    for each in played:
        if each.problem or each.recording is None:
            left = LEFT_WITH.get(each.state, "the law commands the valve again")
            raise CommandFailed(f"broken off: {each.problem or each.state.text}; {left}")
    return [each.recording for each in played if each.recording is not None]


def finished(
    outcome: "Outcome",
    file: "DaemonFile | None",
    arguments: argparse.Namespace,
    *,
    compared: bool = True,
    always_kept: bool = False,
) -> int:
    """Compare, keep, print and draw an outcome; 0 if it passed, else 1.

    Args:
        outcome: of the test.
        file: the daemon's; None where only recordings were given.
        arguments: of the command.
        compared: whether figures are compared with the record before; else the test has done so by its own limits.
        always_kept: whether each is kept, asked for or not, as a trend needs it.
    """
    changed: list[Any] = []
    if file is not None and compared:
        outcome, changed = _compared(outcome, reference_of(outcome.test, file, arguments))
    print(outcome.summary())
    write_json(arguments.json, outcome.as_json() | {"compared": [_change(each) for each in changed]}, indent=1)
    if arguments.picture is not None:
        draw(outcome, arguments.picture)
    if file is not None and (arguments.keep is not None or always_kept):
        path = kept(outcome, file, arguments, arguments.keep or "")
        print(f"kept{'' if arguments.keep is None else f' ({arguments.keep})'.replace('_', ' ')}: {path}")
    return 0 if outcome.passed else 1


def _compared(outcome: "Outcome", before: "Record | None") -> "tuple[Outcome, list[Any]]":
    from positioner.tests_on_the_valve.kept_records import change_table, changes, meaning_table

    if before is None:
        return outcome, []
    told = changes(outcome, before.outcome)
    if not any(each.changed for each in told):
        return replace(outcome, notes=(*outcome.notes, f"nothing has changed since the {before.told}")), told
    others = tuple(each for each in outcome.verdicts if each is not ValveTestVerdict.PASSED)
    tables = (
        *outcome.tables,
        change_table(told, before.told),
        *([meant] if (meant := meaning_table(told)).rows else []),
    )
    return replace(outcome, verdicts=(*others, ValveTestVerdict.CHANGED), tables=tables), told


def kept(outcome: "Outcome", file: "DaemonFile", arguments: argparse.Namespace, kind: str) -> Path:
    """Keep an outcome as a kind, with what was configured, and return its file."""
    from positioner.history.kept_tests import records_folder
    from positioner.tests_on_the_valve.kept_records import keep

    return keep(records_folder(file, arguments.config), outcome, kind, time.time(), configured(file))


def configured(file: "DaemonFile") -> dict[str, Any]:
    """Return what of a daemon's file is kept with a record: tables by name, as they are written."""
    tables = file.model_dump(mode="json", include={"valve", "device", "pressure", "experiment", "law", "control"})
    other_length = "travel_deg" if file.valve.length == "stroke_m" else "stroke_m"
    tables["valve"] = {key: value for key, value in tables["valve"].items() if key != other_length}
    return {name: _as_written(file.valve.kind, table) for name, table in tables.items()}


def _as_written(kind: Kind, table: Any) -> Any:
    if not isinstance(table, dict):
        return table
    told = (as_written(kind, key, value) for key, value in table.items())
    return {key: _as_written(kind, value) for key, value in told}


def draw(outcome: "Outcome", path: Path) -> None:
    """Draw the picture of an outcome.

    Raises:
        InputError: it cannot be written, or it is named as no picture is.
    """
    try:
        outcome.plot().savefig(path)
    except (OSError, ValueError) as error:
        raise InputError(f"--picture {path}", f"cannot be drawn: {error}") from None


def _change(change: Any) -> dict[str, object]:
    return {
        "name": change.quantity.name,
        "before": change.before.figure.value,
        "now": change.quantity.figure.value,
        "deviations": change.deviations,
        "changed": change.changed,
        "means": change.means if change.changed else "",
    }

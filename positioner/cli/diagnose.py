"""`positioner diagnose`: which effect is missing."""

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import CommandFailed, InputError
from config.file_kinds import VALVE_SAID
from positioner.cli.parts.export_arguments import mapping_of
from positioner.cli.parts.fit_arguments import add_noise_and_exports, add_pressure, add_test, read_fitted
from positioner.cli.parts.given_names import files_named, naming
from positioner.cli.parts.model_arguments import read_valve, require_effects
from positioner.cli.parts.next_step import by_pressure_command, discover_command, extend_commands, not_written
from positioner.cli.parts.output_files import writable, write_json
from positioner.cli.parts.progress import Progress, at_work
from workbench.fit.breaking_off import BrokenOff

if TYPE_CHECKING:
    from config.recording import Recording
    from config.valve_file import ValveFile
    from workbench.diagnosis.diagnosis import Diagnosis
    from workbench.diagnosis.extension import Extension
    from workbench.select.tangent_preview import TangentScore

HELP = "find the effect that the model lacks; exit status 1 if anything is missing"
EXAMPLE = "positioner diagnose rec.csv --valve seed --test other.csv --json diagnosed.json"

PREVIEWED = 5  # effects in the line of the preview


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("recordings", type=Path, nargs="+", metavar="REC", help="recordings, CSV or Parquet")
    parser.add_argument("--valve", required=True, metavar="VALVE.toml", help=VALVE_SAID)
    add_test(parser)
    parser.add_argument(
        "--effects",
        nargs="+",
        metavar="NAME",
        help="effects to try, or .py files of your own (all known effects)",
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers as JSON")
    parser.add_argument("--report", type=Path, metavar="FILE.html", help="write a report for a browser")
    parser.add_argument(
        "--experiment",
        type=Path,
        metavar="FILE",
        help="write an input that would tell equally good effects apart",
    )
    parser.add_argument(
        "-o",
        "--out",
        type=Path,
        metavar="BETTER.toml",
        help="write the better valve file, where the verdict is certain",
    )
    parser.add_argument(
        "--add",
        nargs="+",
        default=[],
        metavar="NAME",
        help="with -o: add these effects in any case",
    )
    parser.add_argument("--budget-s", type=float, metavar="S", help="time limit; then prints what is known")
    add_pressure(parser)
    add_noise_and_exports(parser)


def run(arguments: argparse.Namespace) -> int:
    """Diagnose and print; 0 if nothing is missing and nothing in the valve file is off, else 1."""

    from workbench.data.imposed_motion import is_imposed
    from workbench.diagnosis.diagnosis import diagnose
    from workbench.diagnosis.diagnosis_json import as_json
    from workbench.diagnosis.measured_pressure import ByMeasuredPressure
    from workbench.report import Subject, report_diagnosis

    for option in ("experiment", "out"):
        writable(getattr(arguments, option), f"--{option}")
    _require_out(arguments)
    if not mapping_of(arguments).column and all(map(is_imposed, arguments.recordings)):
        from positioner.cli.parts.diagnose_forces import run_forces

        return run_forces(arguments)
    began_s, budget_s = time.monotonic(), inf if arguments.budget_s is None else arguments.budget_s
    valve = read_valve(arguments.valve)
    require_effects(arguments.effects, "--effects")
    require_effects(arguments.add, "--add")
    recordings, test = read_fitted(arguments.recordings, arguments, valve)
    named = files_named(arguments.recordings, arguments.test, arguments.valve)
    with naming(named), _end_without_result(), Progress() as progress:
        diagnosis = diagnose(
            recordings,
            valve,
            test=test,
            effects=arguments.effects,
            on_preview=_tell_preview,
            progress=progress,
            over=(lambda: time.monotonic() - began_s > budget_s),
            from_pressure=arguments.from_pressure,
        )
    commands = extend_commands(diagnosis, arguments)
    print(diagnosis.summary())
    _tell_experiment(diagnosis, arguments.experiment)
    for command in commands:
        alone = "to refit it" if diagnosis.parameters_off else "to add it"
        print(f"{alone}: {command}" if len(commands) == 1 else f"one of: {command}")
    if diagnosis.doubt(ByMeasuredPressure):
        print(f"to diagnose the stem by the measured pressure: {by_pressure_command(arguments)}")
    if diagnosis.verdict == "unexplained":
        print(f"to look for a formula of what is missing: {discover_command(arguments)}")
    if arguments.out is not None:
        added = _add_effects(diagnosis, valve, recordings, test, arguments) if arguments.add else None
        _write_valve(diagnosis, added, arguments)
    if arguments.json is not None:
        written = str(arguments.experiment) if diagnosis.experiment and arguments.experiment else None
        whole = as_json(diagnosis) | {"experiment": written, "seconds": time.monotonic() - began_s}
        write_json(arguments.json, whole)
    if arguments.report is not None:
        files = tuple(str(path) for path in (*arguments.recordings, arguments.test) if path)
        subject = Subject(valve, files, recordings[0].metadata)
        report_diagnosis(diagnosis, arguments.report, subject, commands)
    return 0 if diagnosis.nothing_off else 1


@contextmanager
def _end_without_result() -> Iterator[None]:
    """Say so where the budget is over before anything is known.

    Raises:
        CommandFailed: it is.
    """

    try:
        yield
    except BrokenOff:
        raise CommandFailed("--budget-s ended before the first fit: nothing is known") from None


def _tell_experiment(diagnosis: "Diagnosis", path: Path | None) -> None:
    if diagnosis.experiment is None:
        return
    if path is None:
        if diagnosis.experiment.separates:
            print("--experiment FILE writes the experiment")
        return
    diagnosis.experiment.write(path)
    print(f"{path}: the experiment")


def _require_out(arguments: argparse.Namespace) -> None:
    """Check that what is to be added has a file to be written to.

    Raises:
        InputError: it has none.
    """

    if arguments.add and arguments.out is None:
        raise InputError("--add", "needs -o BETTER.toml, where the valve is written")


def _add_effects(
    diagnosis: "Diagnosis",
    valve: "ValveFile",
    recordings: "list[Recording]",
    test: "Recording | None",
    arguments: argparse.Namespace,
) -> "Extension":
    """Return the valve with the effects that were asked for, gone on from the diagnosis's own fits."""
    from workbench.diagnosis.extension import extend

    named = files_named(arguments.recordings, arguments.test, arguments.valve)
    with naming(named), at_work("extend") as progress:
        return extend(
            recordings,
            valve,
            arguments.add,
            test=test,
            diagnosis=diagnosis,
            progress=progress,
            from_pressure=arguments.from_pressure,
        )


def _write_valve(diagnosis: "Diagnosis", added: "Extension | None", arguments: argparse.Namespace) -> None:
    """Write what was added or found with its journal, where the diagnosis is sure of that; say so where it is not."""
    from config.valve_file import find_valve
    from workbench.diagnosis.extension import extension_of
    from workbench.diagnosis.extension_journal import write_extended

    if added is None and not diagnosis.sure:
        print(not_written(arguments.out, diagnosis))
        return
    journal = write_extended(added or extension_of(diagnosis), find_valve(arguments.valve), arguments.out)
    if added:
        print(added.summary())
    print(f"{arguments.out}: {journal.steps[-1].why}")


def _tell_preview(suspects: "tuple[TangentScore, ...]") -> None:
    named = ", ".join(f"{each.name} {each.score:.2f}" for each in suspects[:PREVIEWED])
    print(f"tangent preview, not a verdict: {named}", flush=True)

"""What to type after a diagnosis: the command that adds what is missing, one a rival, seeks its form, or asks anew."""

import argparse
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from positioner.cli.parts.export_arguments import export_words

if TYPE_CHECKING:
    from workbench.diagnosis.diagnosis import Diagnosis

OUT, FORM = "better.toml", "found.py"


def extend_commands(diagnosis: "Diagnosis", arguments: argparse.Namespace) -> list[str]:
    """Return the `positioner extend` commands that act on a diagnosis: one, or one a rival; none where nothing helps.

    Args:
        diagnosis: with its verdict.
        arguments: of `positioner diagnose`.
    """
    return [extend_command(effects, arguments) for effects in diagnosis.choices]


def extend_command(effects: Sequence[str], arguments: argparse.Namespace) -> str:
    """Return the `positioner extend` command that adds effects, or none, to the valve of a diagnosis or a discovery."""
    fitted = ["--fit", *map(str, arguments.recordings), *_besides(arguments), *_driver_words(arguments)]
    adding = ["--effect", *effects] if effects else []
    return shlex.join(["positioner", "extend", arguments.valve, *adding, *fitted, "-o", OUT])


def discover_command(arguments: argparse.Namespace) -> str:
    """Return the `positioner discover` command that looks for the form of what a diagnosis leaves unexplained."""
    return shlex.join(["positioner", "discover", *_address_words(arguments), *_driver_words(arguments), "-o", FORM])


def by_pressure_command(arguments: argparse.Namespace) -> str:
    """Return the same `positioner diagnose` command, of the stem from its measured pressure on."""
    tried = ["--effects", *arguments.effects] if arguments.effects else []
    return shlex.join(["positioner", "diagnose", *_address_words(arguments), *tried, "--from-pressure"])


def _driver_words(arguments: argparse.Namespace) -> list[str]:
    return ["--from-pressure"] if arguments.from_pressure else []


def _address_words(arguments: argparse.Namespace) -> list[str]:
    return [*map(str, arguments.recordings), "--valve", arguments.valve, *_besides(arguments)]


def _besides(arguments: argparse.Namespace) -> list[str]:
    held_out = ["--test", str(arguments.test)] if arguments.test else []
    noise = [] if arguments.noise_m is None else ["--noise-m", str(arguments.noise_m)]
    return [*held_out, *noise, *export_words(arguments)]


def not_written(path: Path, diagnosis: "Diagnosis") -> str:
    """Return why a diagnosis writes no valve file."""
    why = {
        "adequate": "nothing is missing",
        "missing": "the measured pressure is on another scale than the command",
        "one_of": "several effects do as well; choose by one of the commands",
        "unexplained": "the effects found do not explain the recordings",
        "unjudged": "these recordings cannot show whether anything is missing",
        "unfinished": "the diagnosis was broken off",
        "untrusted": "the fit is not to be trusted",
    }
    return f"{path}: not written: {why[diagnosis.verdict]}"

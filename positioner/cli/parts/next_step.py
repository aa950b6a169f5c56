"""What to type after a diagnosis: the command that adds what is missing, for each rival where there are some."""

import argparse
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from positioner.cli.parts.export_arguments import export_words

if TYPE_CHECKING:
    from workbench.select.diagnosis import Diagnosis

OUT = "better.toml"


def extend_commands(diagnosis: "Diagnosis", arguments: argparse.Namespace) -> list[str]:
    """Return the `positioner extend` commands that act on a diagnosis: one, or one a rival; none where nothing helps.

    Args:
        diagnosis: with its verdict.
        arguments: of `positioner diagnose`.
    """
    added = diagnosis.missing
    if diagnosis.verdict not in ("missing", "one_of") or not added:
        return []
    choices = [added]
    for i, step in enumerate(step for step in diagnosis.steps if step.added):
        choices += [
            (*added[:i], each.name, *added[i + 1 :]) for each in step.indistinguishable if each.name != added[i]
        ]
    return [_extend(effects, arguments) for effects in choices]


def _extend(effects: Sequence[str], arguments: argparse.Namespace) -> str:
    fitted = [str(each) for each in arguments.recordings]
    held_out = ["--test", str(arguments.test)] if arguments.test else []
    words = ["positioner", "extend", arguments.valve, "--effect", *effects, "--fit", *fitted, *held_out]
    noise = [] if arguments.noise_m is None else ["--noise-m", str(arguments.noise_m)]
    return shlex.join([*words, *noise, *export_words(arguments), "-o", OUT])


def not_written(path: Path, diagnosis: "Diagnosis") -> str:
    """Return why a diagnosis writes no valve file."""
    why = {
        "adequate": "nothing is missing",
        "one_of": "several effects do as well; choose by one of the commands",
        "unexplained": "what was found does not explain the recordings",
        "unjudged": "the noise is unknown, and with it whether anything is missing",
        "unfinished": "the diagnosis was broken off",
        "untrusted": "what was found is not to be trusted",
    }
    return f"{path}: not written: {why[diagnosis.verdict]}"

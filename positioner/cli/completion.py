"""`positioner completion`: what a shell reads to complete commands, options and file names by the tabulator."""

import argparse
from pathlib import Path

from config.extras import import_extra

HELP = "print the completion script of a shell"
EXAMPLE = "positioner completion bash > positioner.bash; source positioner.bash"

SHELLS = ("bash", "zsh", "tcsh")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("shell", choices=SHELLS, help="the shell")


def run(arguments: argparse.Namespace) -> int:
    """Print the words of the shell; 0."""
    from positioner.cli.main import command_parser

    shtab = import_extra("shtab", "positioner completion")
    parser = command_parser()
    _complete_paths(parser, shtab.FILE)
    print(shtab.complete(parser, arguments.shell))
    return 0


def _complete_paths(parser: argparse.ArgumentParser, how: object) -> None:
    """Let arguments that are paths be completed as file names, those of all commands."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _complete_paths(command, how)
        elif action.type is Path or action.dest == "valve":
            action.complete = how  # type: ignore[attr-defined]

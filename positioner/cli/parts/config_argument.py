"""Which file a command is about: `--config CONFIG.toml` in every command, or the file alone where it comes first."""

import argparse
from pathlib import Path

from config.errors import InputError

METAVAR = "CONFIG.toml"


def add_config(
    parser: argparse.ArgumentParser, *, many: bool = False, metavar: str = METAVAR, text: str = "the daemon's file"
) -> None:
    """Declare both ways to say it.

    Args:
        parser: of the command.
        many: whether it may be several.
        metavar: what the file is called.
        text: what it is for.
    """
    parser.add_argument("config", type=Path, nargs="*" if many else "?", metavar=metavar, help=text)
    parser.add_argument(
        "--config",
        dest="config_option",
        type=Path,
        action="append",
        default=[],
        metavar=metavar,
        help="the same file, as an option",
    )


def config_files(arguments: argparse.Namespace) -> list[Path]:
    """Return the files, however they were said."""
    said = arguments.config if isinstance(arguments.config, list) else [arguments.config]
    return [each for each in (*said, *arguments.config_option) if each is not None]


def config_file(arguments: argparse.Namespace) -> Path:
    """Return the only file.

    Raises:
        InputError: there is none, or more than one.
    """

    said = config_files(arguments)
    if len(said) != 1:
        raise InputError(METAVAR, f"one file is needed, got {len(said) or 'none'}")
    return said[0]

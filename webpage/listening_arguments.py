"""Where a command listens: `--listen-host` and `--listen-port` in every command that does; what pages add to them."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import InputError

if TYPE_CHECKING:
    from webpage.server import Listening

MOST_PORT = 65535  # 16 bits


def add_listening(parser: argparse.ArgumentParser, port: int | None = None) -> None:
    """Declare where it listens; without a port of its own, at one that is free."""
    parser.add_argument("--listen-host", default="127.0.0.1", help="address to listen on; this machine alone")
    free = " (8765, or a free one)" if port is None else ""
    parser.add_argument("--listen-port", type=int, default=port, metavar="N", help=f"port to listen on{free}")


def add_page(parser: argparse.ArgumentParser) -> None:
    """Declare where a page listens, who comes in, and whether a browser is opened."""
    add_listening(parser)
    parser.add_argument(
        "--password-file",
        type=Path,
        metavar="FILE",
        help="its first line is the password for everybody; needed with --listen-host",
    )
    parser.add_argument("--no-open", action="store_true", help="print the address only; open no browser")


def listening(arguments: argparse.Namespace) -> "Listening":
    """Return where to listen.

    Raises:
        InputError: a port that is none, or a password file that cannot be read or begins with nothing.
    """
    from webpage.server import Listening

    if arguments.listen_port is not None:
        require_port("--listen-port", arguments.listen_port)
    password = ""
    if arguments.password_file is not None:
        try:
            password = arguments.password_file.read_text(encoding="utf-8").partition("\n")[0].strip()
        except (OSError, UnicodeDecodeError) as error:
            raise InputError(str(arguments.password_file), f"cannot be read: {error}") from None
        if not password:
            raise InputError(str(arguments.password_file), "its first line must be the password; it is empty")
    return Listening(arguments.listen_host, arguments.listen_port, password)


def require_port(option: str, port: int) -> None:
    """Check a port to listen at.

    Raises:
        InputError: it is none.
    """

    if not 0 <= port <= MOST_PORT:
        raise InputError(option, f"must lie between 0 (any free one) and {MOST_PORT}, got {port}")

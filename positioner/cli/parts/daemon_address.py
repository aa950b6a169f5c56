"""Where the daemon is, for the commands that talk to its registers."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import InputError

if TYPE_CHECKING:
    from config.tls_table import Tls
    from positioner.dcs import Dcs

HANDSHAKE_TIMEOUT_S = 2.0
LONGEST_SHOWN = 40
"""Characters of a wrong argument that a message shows."""


def add_connection(parser: argparse.ArgumentParser) -> None:
    """Declare the options that say where."""
    parser.add_argument(
        "--config", type=Path, metavar="CONFIG.toml", help="the daemon's file, which names host and port"
    )
    parser.add_argument("--valve", metavar="NAME", help="the valve's name, where the file has several")
    parser.add_argument("--host", help="the daemon's host (127.0.0.1)")
    parser.add_argument("--port", type=_whole("a port", 1, 65535), help="its supervisory port (5502)")
    parser.add_argument("--unit", type=_whole("a Modbus unit", 0, 255), help="the valve's Modbus unit (1)")
    add_tls(parser, ": certificate of the authority, certificate of this client, and its key")


def add_tls(parser: argparse.ArgumentParser, text: str) -> None:
    """Declare what a secured connection is made with."""
    files = ("AUTHORITY.pem", "CERTIFICATE.pem", "KEY")
    parser.add_argument("--tls", nargs=3, type=Path, metavar=files, help=f"use Modbus/TCP Security{text}")


def _whole(what: str, least: int, most: int) -> Callable[[str], int]:
    def number(text: str) -> int:
        if not (text.isascii() and text.isdigit() and len(text) <= len(str(most)) and least <= int(text) <= most):
            shown = text if len(text) <= LONGEST_SHOWN else f"{text[:LONGEST_SHOWN]}.."
            raise argparse.ArgumentTypeError(f"{shown!r} is not {what}, {least} to {most}")
        return int(text)

    return number


def connect_dcs(arguments: argparse.Namespace) -> "Dcs":
    """Return a DCS for that place, to be used as a context.

    Raises:
        InputError: a fault in the daemon's file, or a valve is named without it; or that file asks for certificates.
    """
    from config.daemon_file import SupervisoryTable, load_daemon
    from positioner.dcs import Dcs

    if arguments.valve is not None and arguments.config is None:
        raise InputError("--valve", "needs --config, the daemon's file that names it; or say --unit")
    where = load_daemon(arguments.config, arguments.valve).supervisory if arguments.config else SupervisoryTable()
    if where.tls and arguments.tls is None and arguments.host is None and arguments.port is None:
        raise InputError(str(arguments.config), "supervisory.tls: asks for a certificate of whoever connects: --tls")
    host, port, unit = (
        getattr(where, key) if (said := getattr(arguments, key)) is None else said for key in ("host", "port", "unit")
    )
    return Dcs(host, port, unit, tls=None if arguments.tls is None else client_tls(*arguments.tls))


def client_tls(authority: Path, certificate: Path, key: Path) -> "Tls":
    """Return what a client of a daemon shows, and by whom the daemon's own certificate is signed."""
    from config.tls_table import Tls

    return Tls(authority=authority, certificate=certificate, key=key, handshake_timeout_s=HANDSHAKE_TIMEOUT_S)

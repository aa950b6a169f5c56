"""`positioner page`: running valves as a page in a browser."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import InputError
from northbound.served_valves import add_certificates, certificates, places_in, set_role_password
from webpage.listening_arguments import add_page, listening

if TYPE_CHECKING:
    from northbound.observer.watched_valves import Place

HELP = "show running valves in a browser; whoever signs in may control them"
EXAMPLE = "positioner page --config daemon.toml --roles roles.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument(
        "--config",
        type=Path,
        action="append",
        metavar="CONFIG.toml",
        help="a daemon's file, with all its valves; may be given several times",
    )
    parser.add_argument("--host", help="host of the daemon, where there is no --config (127.0.0.1)")
    parser.add_argument("--port", type=int, help="its supervisory port (5502)")
    parser.add_argument("--unit", type=int, help="the valve's Modbus unit (1)")
    add_certificates(parser)
    parser.add_argument("--roles", type=Path, metavar="FILE", help="file with the passwords of operator and engineer")
    parser.add_argument(
        "--set-password",
        choices=("operator", "engineer"),
        help="ask for the password of this role, write it to --roles, and end",
    )
    add_page(parser)


def run(arguments: argparse.Namespace) -> int:
    """Serve until told to end; 0."""
    from config.passwords import SignIn
    from config.role_passwords import read_passwords
    from northbound.operator_page.page import serve_valves

    if arguments.set_password is not None:
        return set_role_password(arguments.roles, arguments.set_password, "--roles")
    places = list(daemon_places(arguments))
    sign_in = None if arguments.roles is None else SignIn(read_passwords(arguments.roles))
    where = listening(arguments)
    serve_valves(places, where, sign_in, opens_browser=not arguments.no_open)
    return 0


def daemon_places(arguments: argparse.Namespace) -> "Iterator[Place]":
    """Yield where each valve is served.

    Raises:
        InputError: a fault in a daemon's file; two valves of one name; an address beside a file.
    """
    from config.daemon_file import SupervisoryTable
    from config.loading import validate
    from northbound.observer.watched_valves import Place

    tls, tls_of = certificates(arguments)
    said = [key for key in ("host", "port", "unit") if getattr(arguments, key) is not None]
    if arguments.config is None:
        where = validate(SupervisoryTable, {key: getattr(arguments, key) for key in said}, "the daemon", Path())
        yield Place(f"{where.host}:{where.port}", where.host, where.port, where.unit, tls=tls, tls_of=tls_of)
        return
    if said:
        raise InputError(f"--{said[0]}", "names the daemon, and so does --config: give one of them")
    yield from places_in(arguments.config, tls, tls_of)

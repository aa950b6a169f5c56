"""`positioner page`: running valves as a page in a browser."""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from positioner.cli.parts.daemon_address import client_tls
from positioner.cli.parts.page_address import MOST_PORT

if TYPE_CHECKING:
    from config.roles import Role
    from config.tls_table import Tls
    from positioner.pages.operator_page.watched_valves import Place

HELP = "open running valves in a browser: live trends, states and health in words; controls after signing in"
EXAMPLE = "positioner page --config daemon.toml --roles roles.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument(
        "--config",
        type=Path,
        action="append",
        metavar="CONFIG.toml",
        help="a daemon's file: all its valves; repeatable",
    )
    parser.add_argument("--host", help="a daemon's host, without --config (127.0.0.1)")
    parser.add_argument("--port", type=int, help="its supervisory port (5502)")
    parser.add_argument("--unit", type=int, help="the valve's Modbus unit (1)")
    pem = ("AUTHORITY.pem", "CERTIFICATE.pem", "KEY")
    parser.add_argument("--tls", nargs=3, type=Path, metavar=pem, help="read with this observer's certificate")
    parser.add_argument(
        "--write-tls",
        nargs=2,
        type=Path,
        action="append",
        default=[],
        metavar=pem[1:],
        help="write with this certificate, as the role that it names; once for each role",
    )
    parser.add_argument("--roles", type=Path, metavar="FILE", help="the passwords of operator and engineer")
    parser.add_argument(
        "--set-password", choices=("operator", "engineer"), help="ask for this role's password, keep it in --roles, end"
    )
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep what is seen of friction over restarts")
    parser.add_argument("--listen-host", default="127.0.0.1", help="where the page listens (127.0.0.1)")
    parser.add_argument("--listen-port", type=_port, metavar="N", help="at which port (8765, or another free one)")
    parser.add_argument(
        "--password-file", type=Path, metavar="FILE", help="its first line is asked of everybody; other hosts need it"
    )
    parser.add_argument("--no-open", action="store_true", help="print the address, open no browser")


def run(arguments: argparse.Namespace) -> int:
    """Serve until told to end; 0."""
    from positioner.cli.parts.page_address import listening
    from positioner.pages.operator_page.page import serve_valves
    from positioner.pages.operator_page.role_passwords import read_passwords
    from positioner.pages.parts.sessions import SignIn

    if arguments.set_password is not None:
        return _set_password(arguments.roles, arguments.set_password)
    places = [replace(each, keep=arguments.keep) for each in _places(arguments)]
    sign_in = None if arguments.roles is None else SignIn(read_passwords(arguments.roles))
    where = listening(
        argparse.Namespace(
            host=arguments.listen_host, port=arguments.listen_port, password_file=arguments.password_file
        )
    )
    serve_valves(places, where, sign_in, opens_browser=not arguments.no_open)
    return 0


def _places(arguments: argparse.Namespace) -> "Iterator[Place]":
    """Yield where each valve is served.

    Raises:
        InputError: a fault in a daemon's file; two valves of one name; an address beside a file.
    """
    from config.daemon_file import SupervisoryTable, load_valves
    from config.errors import InputError
    from config.loading import validated
    from positioner.pages.operator_page.watched_valves import Place

    tls, tls_of = _certificates(arguments)
    said = [key for key in ("host", "port", "unit") if getattr(arguments, key) is not None]
    if arguments.config is None:
        where = validated(SupervisoryTable, {key: getattr(arguments, key) for key in said}, "the daemon", Path())
        yield Place(f"{where.host}:{where.port}", where.host, where.port, where.unit, tls=tls, tls_of=tls_of)
        return
    if said:
        raise InputError(f"--{said[0]}", "is given, so --config must not be: the file says where")
    names: set[str] = set()
    for path in arguments.config:
        for file in load_valves(path):
            name, where = file.valve.name, file.supervisory
            if name in names:
                raise InputError(str(path), f"valve.name: {name!r} is also in another --config; a page tells by names")
            names.add(name)
            recordings = None if file.recorder is None else path.parent / file.recorder.folder
            yield Place(
                name, where.host, where.port, where.unit, file.valve.stroke_m, recordings, tls=tls, tls_of=tls_of
            )


def _certificates(arguments: argparse.Namespace) -> "tuple[Tls | None, dict[Role, Tls]]":
    """Return the observer's certificate, and those of the roles that they name."""
    import ssl

    from config.errors import InputError
    from fieldbus.modbus.tls import identity_in

    if arguments.tls is None:
        if arguments.write_tls:
            raise InputError("--write-tls", "needs --tls, who signed for the daemon, too")
        return None, {}
    authority, certificate, key = arguments.tls
    of: dict[Role, Tls] = {}
    for certificate_of, key_of in arguments.write_tls:
        try:
            der = ssl.PEM_cert_to_DER_cert(certificate_of.read_text(encoding="ascii"))
        except (OSError, ValueError) as error:
            raise InputError(str(certificate_of), f"is no certificate in PEM form: {error}") from None
        of[identity_in(der).role] = client_tls(authority, certificate_of, key_of)
    return client_tls(authority, certificate, key), of


def _set_password(file: Path | None, role: str) -> int:
    import getpass
    import sys

    from config.errors import InputError
    from positioner.pages.operator_page.role_passwords import set_password

    if file is None:
        raise InputError("--set-password", "needs --roles FILE, where it is kept")
    if sys.stdin.isatty():
        text = getpass.getpass(f"password of the {role}: ")
        if getpass.getpass("again: ") != text:
            raise InputError("password", "the two are not the same; nothing was changed")
    else:
        text = sys.stdin.readline().rstrip("\n")
    set_password(file, role, text)
    print(f"{file}: the {role}'s password is set")
    return 0


def _port(text: str) -> int:
    if not text.isdecimal() or int(text) > MOST_PORT:
        raise argparse.ArgumentTypeError(f"must lie between 0 (any free one) and {MOST_PORT}, got {text}")
    return int(text)

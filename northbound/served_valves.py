"""The valves of daemons' files, for the commands that observe them: where each is served, and by which certificates."""

import argparse
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import InputError
from config.roles import Role
from positioner.cli.parts.daemon_address import client_tls

if TYPE_CHECKING:
    from config.tls_table import Tls
    from northbound.observer.watched_valves import Place

PEM = ("AUTHORITY.pem", "CERTIFICATE.pem", "KEY")


def add_certificates(parser: argparse.ArgumentParser) -> None:
    """Declare the options that say by which certificates daemons are read and written."""
    parser.add_argument("--tls", nargs=3, type=Path, metavar=PEM, help="read with this certificate of role observer")
    parser.add_argument(
        "--write-tls",
        nargs=2,
        type=Path,
        action="append",
        default=[],
        metavar=PEM[1:],
        help="write with this certificate, of role operator or engineer; once for each role",
    )


def certificates(arguments: argparse.Namespace) -> "tuple[Tls | None, dict[Role, Tls]]":
    """Return the observer's certificate, and those of the roles that they name.

    Raises:
        InputError: one is none, or nobody said who signed for the daemon.
    """
    import ssl

    from fieldbus.modbus.client_roles import identity_in

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


def places_in(
    paths: Sequence[Path], tls: "Tls | None" = None, tls_of: "Mapping[Role, Tls] | None" = None
) -> "Iterator[Place]":
    """Yield where each valve of these files is served.

    Raises:
        InputError: a fault in a file; two valves of one name.
    """
    from config.daemon_file import load_valves
    from northbound.observer.watched_valves import Place

    names: set[str] = set()
    for path in paths:
        for file in load_valves(path):
            name, where = file.valve.name, file.supervisory
            if name in names:
                raise InputError(str(path), f"valve.name: {name!r} is also in another file; valves are told by names")
            names.add(name)
            yield Place(
                name,
                where.host,
                where.port,
                where.unit,
                file.valve.stroke_m,
                recordings=None if file.recorder is None else path.parent / file.recorder.folder,
                tls=tls,
                tls_of=tls_of or {},
                history=None if file.history is None else path.parent / file.history.folder,
                range_pa=(file.pressure.minimum_pa, file.pressure.maximum_pa),
                settings=file,
                file=path,
            )


def set_role_password(file: Path | None, role: str, option: str) -> int:
    """Ask for a role's password and keep it; 0.

    Raises:
        InputError: nobody said where, the password is too short, or the file cannot be written.
    """
    import getpass

    from config.role_passwords import set_password

    if file is None:
        raise InputError("--set-password", f"needs {option} FILE, where it is kept")
    if sys.stdin.isatty():
        text = getpass.getpass(f"password of the {role}: ")
        if getpass.getpass("again: ") != text:
            raise InputError("password", "the two are not the same; nothing was changed")
    else:
        text = sys.stdin.readline().rstrip("\n")
    set_password(file, role, text)
    print(f"{file}: the {role}'s password is set")
    return 0

"""`positioner opcua`: running valves for OPC UA clients."""

import argparse
import asyncio
from pathlib import Path

from config.errors import InputError
from config.extras import import_extra
from northbound.served_valves import add_certificates, certificates, places_in, set_role_password
from positioner.cli.parts.config_argument import add_config, config_files
from webpage.listening_arguments import add_listening, require_port

HELP = "serve running valves to OPC UA clients, signed and encrypted, with users by role"
EXAMPLE = "positioner opcua daemon.toml --users users.json --keys opcua-keys"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser, many=True, text="a daemon's file, with all its valves")
    add_certificates(parser)
    parser.add_argument(
        "--users", type=Path, metavar="FILE", help="file with the passwords of observer, operator and engineer"
    )
    parser.add_argument(
        "--set-password",
        choices=("observer", "operator", "engineer"),
        help="ask for the password of this user, write it to --users, and end",
    )
    parser.add_argument(
        "--keys",
        type=Path,
        metavar="FOLDER",
        help="folder with the certificate of this server and those of trusted clients",
    )
    add_listening(parser, 4840)


def run(arguments: argparse.Namespace) -> int:
    """Serve until told to end; 0.

    Raises:
        InputError: a fault in a file; no users, no keys; it cannot listen there.
    """
    from config.passwords import SignIn
    from config.role_passwords import read_passwords

    if arguments.set_password is not None:
        return set_role_password(arguments.users, arguments.set_password, "--users")
    if not (files := config_files(arguments)):
        raise InputError("CONFIG.toml", "is needed: the daemon's file that says where its valves are served")
    for option in ("users", "keys"):
        if getattr(arguments, option) is None:
            raise InputError(f"--{option}", "is needed: nobody comes in without a password and a trusted certificate")
    require_port("--listen-port", arguments.listen_port)
    sign_in = SignIn(read_passwords(arguments.users))
    places = list(places_in(files, *certificates(arguments)))
    import_extra("asyncua", "positioner opcua")
    from northbound.observer.watched_valves import watching
    from northbound.opcua.application_keys import ApplicationKeys
    from northbound.opcua.valve_server import Listening, application_uri, serve_opcua

    keys = ApplicationKeys(arguments.keys, application_uri(), arguments.listen_host)
    if keys.made:
        print(f"{keys.certificate}: made; clients are to trust it")

    def ready(port: int) -> None:
        names = ", ".join(each.name for each in places)
        print(f"serving {names} on opc.tcp://{arguments.listen_host}:{port}", flush=True)

    with watching(places) as valves:
        where = Listening(arguments.listen_host, arguments.listen_port)
        asyncio.run(serve_opcua(valves, where, keys, sign_in, ready))
    return 0

"""`positioner set`: writes one of the daemon's registers by name."""

import argparse

from positioner.cli.parts.daemon_address import add_connection, connect_dcs

HELP = "write a register of a running daemon"
EXAMPLE = "positioner set reference 0.5"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("name", metavar="NAME", help="a writable register of `positioner map`")
    parser.add_argument("value", metavar="VALUE", help="a number; for mode also hold, manual, automatic")
    add_connection(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write it."""
    from positioner.dcs import value_of

    value = value_of(arguments.name, arguments.value)
    with connect_dcs(arguments) as dcs:
        dcs.set(arguments.name, value)
    return 0

"""`positioner get`: reads the daemon's registers by name."""

import argparse
import json

from config.registers import BY_NAME, register_named
from positioner.cli.parts.daemon_address import add_connection, connect_dcs

HELP = "read registers of a running daemon, by name (without a name: all)"
EXAMPLE = "positioner get position state fault"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="a register of `positioner map`")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    add_connection(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print the values."""

    from config.json_value import json_value
    from northbound.observer.register_words import in_words

    names = arguments.names or list(BY_NAME)
    for name in names:
        register_named(name)
    with connect_dcs(arguments) as dcs:
        values = dcs.get_all(*names)
    if arguments.json:
        print(json.dumps(json_value(values)))
        return 0
    width = max(map(len, names)) if len(names) > 1 else 0
    for name, value in values.items():
        unit = BY_NAME[name].unit if width and BY_NAME[name].unit != "1" else ""
        number = f"{value:.9g}" if BY_NAME[name].type == "float32" else f"{value:.0f}"
        parts = (f"{name:{width}} " if width else "", number, unit, in_words(name, value, values))
        print(" ".join(each for each in parts if each))
    return 0

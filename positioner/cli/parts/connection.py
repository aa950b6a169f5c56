"""Where the daemon is, for the commands that talk to its registers."""

import argparse
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from positioner.dcs import Dcs


def add_connection(parser: argparse.ArgumentParser) -> None:
    """Declare the options that say where."""
    parser.add_argument("--host", default="127.0.0.1", help="the daemon's host (127.0.0.1)")
    parser.add_argument("--port", type=int, default=5502, help="its supervisory port (5502)")
    parser.add_argument("--unit", type=int, default=1, help="its Modbus unit (1)")


def connected(arguments: argparse.Namespace) -> "Dcs":
    """Return a DCS for that place, to be used as a context."""
    from positioner.dcs import Dcs

    return Dcs(arguments.host, arguments.port, arguments.unit)

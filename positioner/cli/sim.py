"""`positioner sim`: the simulated valve slave alone, until a signal ends it."""

import argparse
import signal
import time

from positioner.cli.parts.config_argument import add_config, config_file

HELP = "run a simulated valve as a device on a bus; prints its address when it is ready"
EXAMPLE = "positioner sim config/profiles/slave.toml --listen-port 0"
CATCH_UP_EVERY_S = 0.02


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser, text="the slave file")
    parser.add_argument(
        "--listen-port",
        type=_port,
        metavar="N",
        help="port or loopback CAN channel (that of the file); 0 takes a free one",
    )


def run(arguments: argparse.Namespace) -> int:
    """Serve until a signal ends it.

    Raises:
        InputError: a fault in a file, or the port is in use.
    """
    from sim.slave.slave import Slave

    ended: list[int] = []  # not an Event: a handler that sets one may deadlock with the wait it interrupts
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda number, _frame: ended.append(number))
    slave = Slave(config_file(arguments), arguments.listen_port)
    print(f"listening on {slave.address}", flush=True)
    while not ended:
        time.sleep(CATCH_UP_EVERY_S)
        slave.catch_up()
    slave.stop()
    return 0


def _port(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) <= 5 and int(text) <= 65535):
        raise argparse.ArgumentTypeError(f"{text[:40]!r} is not a port, 0 to 65535")
    return int(text)

"""`positioner run`: the daemon."""

import argparse
from pathlib import Path

HELP = "run the daemon: position the valves of CONFIG.toml and serve their supervisory registers"
EXAMPLE = "positioner run daemon.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("config", type=Path, metavar="CONFIG.toml")


def run(arguments: argparse.Namespace) -> int:
    """Run until SIGTERM or Ctrl-C, which leave each valve in its configured safe state."""
    from config.daemon_file import load_valves
    from positioner.daemon.service import serve

    return serve(load_valves(arguments.config), arguments.config)

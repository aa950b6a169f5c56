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
    from positioner.daemon.platform_needs import require_platform

    require_platform()
    # Before the daemon is loaded, which takes longer: most mistakes are in a file.
    files = load_valves(arguments.config)
    from positioner.cli.parts.extended_valves import extended_valve_of
    from positioner.daemon.service import serve

    source = str(arguments.config)
    return serve(files, arguments.config, [extended_valve_of(file, source) for file in files])

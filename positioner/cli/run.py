"""`positioner run`: the daemon."""

import argparse

from positioner.cli.parts.config_argument import add_config, config_file
from positioner.cli.parts.extended_valves import load_extended_valve
from positioner.daemon.platform_needs import require_platform

HELP = "run the daemon: position the valves of CONFIG.toml and serve their registers to the DCS"
EXAMPLE = "positioner run daemon.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run until SIGTERM or Ctrl-C, which leave each valve in its configured safe state."""
    from config.daemon_file import load_valves

    require_platform()
    # Before the daemon is loaded, which takes longer: most mistakes are in a file.
    path = config_file(arguments)
    files = load_valves(path)
    from positioner.daemon.service import serve

    return serve(files, path, [load_extended_valve(file, str(path)) for file in files])

"""`positioner metrics`: running valves for Prometheus."""

import argparse
from pathlib import Path
from threading import Event

from config.errors import InputError
from config.extras import import_extra
from northbound.served_valves import places_in
from positioner.cli.parts.config_argument import add_config, config_files
from positioner.cli.parts.daemon_address import client_tls
from webpage.listening_arguments import add_listening

HELP = "serve the metrics of running valves to Prometheus (HTTP, /metrics)"
EXAMPLE = "positioner metrics daemon.toml --listen-port 9502"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser, many=True, text="a daemon's file, with all its valves")
    pem = ("AUTHORITY.pem", "CERTIFICATE.pem", "KEY")
    parser.add_argument("--tls", nargs=3, type=Path, metavar=pem, help="read with this certificate of role observer")
    add_listening(parser, 9502)


def run(arguments: argparse.Namespace) -> int:
    """Serve until told to end."""

    from webpage.listening_arguments import require_port

    import_extra("prometheus_client", "positioner metrics")
    from northbound.metrics.exporter import serve_metrics
    from northbound.metrics.scraped_valve import ScrapedValve

    if not (files := config_files(arguments)):
        raise InputError("CONFIG.toml", "is needed: the daemon's file that says where its valves are served")
    require_port("--listen-port", arguments.listen_port)
    tls = None if arguments.tls is None else client_tls(*arguments.tls)
    valves = [ScrapedValve(each.name, (each.host, each.port, each.unit), tls) for each in places_in(files)]
    port = serve_metrics(valves, arguments.listen_host, arguments.listen_port)
    print(
        f"serving metrics of {', '.join(each.name for each in valves)} on http://{arguments.listen_host}:{port}/metrics",
        flush=True,
    )
    Event().wait()
    return 0

"""Programs that read the supervisory registers, and what configures each for the valves of a daemon's file."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from config.errors import InputError
from northbound.client_configurations.home_assistant import home_assistant
from northbound.client_configurations.modbus_exporter import modbus_exporter
from northbound.client_configurations.node_red import node_red
from northbound.client_configurations.telegraf import telegraf

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile

READERS: "dict[str, tuple[str, Callable[[Sequence[DaemonFile]], str]]]" = {
    "telegraf": ("Telegraf", telegraf),
    "modbus-exporter": ("modbus_exporter", modbus_exporter),
    "home-assistant": ("Home Assistant", home_assistant),
    "node-red": ("Node-RED", node_red),
}
"""By `--format`: the program's name, and what writes its configuration."""


def configuration(reader: str, files: "Sequence[DaemonFile]", source: str) -> str:
    """Return the configuration of a program.

    Raises:
        InputError: the registers are served on TLS, which none of them speaks on Modbus.
    """
    name, written = READERS[reader]
    if any(file.supervisory.tls for file in files):
        raise InputError(source, f"supervisory.tls: {name} speaks no Modbus/TCP Security; serve it where it runs")
    return written(files)

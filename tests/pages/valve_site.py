"""A valve to look at: a slave and a daemon as processes, and the daemon's file as a page's `--config` needs it."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from positioner.cli.parts.children import port_in
from tests.children import Child, child

SLAVE = "[sensor]\nnoise_std_m = 1e-5\n[initial]\nposition_m = 0.03\npressure_pa = 24000.0\n"
DAEMON = """[valve]
name = "FV-101"
stroke_m = 0.1016
[device]
port = {device_port}
reply_timeout_s = 2.0
[cycle]
period_s = 5e-3
[supervisory]
port = {port}
[recorder]
folder = "recordings"
[history]
folder = "history"
[control]
law = "seed"
[law]
b_over_c_pa_per_m = -814542.6
k_over_c_pa = -22068.2
"""


class Site(NamedTuple):
    """A slave and a daemon that run."""

    config: Path
    port: int
    """Where the daemon serves."""
    slave: Child
    daemon: Child


@contextmanager
def valve_site(folder: Path) -> Iterator[Site]:
    """Run them; the daemon's file says at last at which port it serves."""
    (folder / "slave.toml").write_text(SLAVE)
    with child("sim", folder / "slave.toml", "--listen-port", "0") as (slave, listening):
        config = folder / "daemon.toml"
        config.write_text(DAEMON.format(device_port=port_in(listening), port=0))
        with child("run", config) as (daemon, serving):
            config.write_text(DAEMON.format(device_port=port_in(listening), port=port_in(serving)))
            yield Site(config, port_in(serving), slave, daemon)

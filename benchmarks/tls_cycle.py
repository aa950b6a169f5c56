"""One cycle over Modbus/TCP Security: the daemon's full cycle against a bare pymodbus loop, and a handshake.

Both talk, in turn, to simulated slaves of the same kind, processes of their own in lockstep, with mutual TLS 1.3.
"""

import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pymodbus.client import ModbusTlsClient

from benchmarks.bus import ANY_PORT, measured, slave_process
from benchmarks.cycle_time import bare_loop, daemon_loop, rates
from config.device import ModbusTcpDevice
from config.roles import Role
from config.tls_table import Tls
from drivers import driver_for
from fieldbus.modbus.tls import client_context
from positioner.cli.parts.trial_authority import Authority, Owner
from positioner.testing.child_process import port_in

CYCLES = 4000
HANDSHAKES = 50


def report() -> list[str]:
    """Return lines: rates of the bare loop and the full cycle, their ratio, and the time to connect."""
    with tempfile.TemporaryDirectory() as name:
        tls = certificates(Path(name))
        with slave(Path(name, "a.toml")) as port, slave(Path(name, "b.toml")) as other_port:
            times, connect_s = full_cycle(tls, port, other_port)
    return [
        *rates("pymodbus TLS", times["bare"], times["full"]),
        f"open, handshake included          {1e3 * statistics.median(connect_s):7.1f} ms",
    ]


def certificates(folder: Path) -> Tls:
    """Make them; return the daemon's."""
    authority = Authority(folder, days=1)
    authority.sign(Owner("device", ("127.0.0.1",)))
    authority.sign(Owner("daemon", (), Role.OPERATOR))
    return Tls(authority=folder / "authority.pem", certificate=folder / "daemon.pem", key=folder / "daemon.key")


def full_cycle(tls: Tls, port: int, other_port: int) -> tuple[dict[str, list[float]], list[float]]:
    """Return the times of bare and full cycles, us, and of opening the driver, s."""
    driver = driver_for(ModbusTcpDevice(port=port, reply_timeout_s=1.0, tls=tls))
    connect_s = []
    for _ in range(HANDSHAKES):
        start_s = time.perf_counter()
        driver.open()
        connect_s.append(time.perf_counter() - start_s)
    context = client_context(tls)
    context.check_hostname = False  # the bare client cannot
    with daemon_loop(driver) as full, ModbusTlsClient("127.0.0.1", port=other_port, sslctx=context) as bare:
        return measured({"bare": bare_loop(bare), "full": full}, CYCLES), connect_s


@contextmanager
def slave(file: Path) -> Iterator[int]:
    """Run a simulated slave in lockstep, its certificates beside its file; give its port."""
    table = "[bus.tls]\nauthority = 'authority.pem'\ncertificate = 'device.pem'\nkey = 'device.key'\n"
    with slave_process(file, table, *ANY_PORT) as ready:
        yield port_in(ready)


if __name__ == "__main__":
    print("\n".join(report()))

"""One cycle over Modbus/TCP Security: the daemon's full cycle against a bare pymodbus loop, and a handshake.

Both talk, in turn, to simulated slaves of the same kind, processes of their own in lockstep, with mutual TLS 1.3.
"""

import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pymodbus.client import ModbusTlsClient

from benchmarks.bus import COMMAND, PUSH_PA, measured, ratio
from benchmarks.cycle_time import DAEMON, FIRST, full_loop
from config.device import ModbusTcpDevice
from config.roles import Role
from config.tls_table import Tls
from drivers import driver_for
from fieldbus.modbus.tls import client_context
from positioner.cli.parts.trial_authority import Authority, Owner
from positioner.control.controller import Controller
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace
from positioner.daemon.recorder import Recorder

CYCLES = 4000
HANDSHAKES = 50
TARGET_RATIO = 0.8


def report() -> list[str]:
    """Return lines: rates of the bare loop and the full cycle, their ratio, and the time to connect."""
    with tempfile.TemporaryDirectory() as name:
        tls = certificates(Path(name))
        with slave(Path(name, "a.toml")) as port, slave(Path(name, "b.toml")) as other_port:
            times, connect_s = full_cycle(Path(name), tls, port, other_port)
    bare_us, full_us = statistics.median(times["bare"]), statistics.median(times["full"])
    return [
        f"bare pymodbus TLS, function 23    {1e6 / bare_us:7.0f} cycles/s",
        f"the daemon's full cycle           {1e6 / full_us:7.0f} cycles/s",
        f"ratio                             {ratio(times['bare'], times['full'])}, target at least {TARGET_RATIO}",
        f"open, handshake included          {1e3 * statistics.median(connect_s):7.1f} ms",
    ]


def certificates(folder: Path) -> Tls:
    """Make them; return the daemon's."""
    authority = Authority(folder, days=1)
    authority.sign(Owner("device", ("127.0.0.1",)))
    authority.sign(Owner("daemon", (), Role.OPERATOR))
    return Tls(authority=folder / "authority.pem", certificate=folder / "daemon.pem", key=folder / "daemon.key")


def full_cycle(folder: Path, tls: Tls, port: int, other_port: int) -> tuple[dict[str, list[float]], list[float]]:
    """Return the times of bare and full cycles, us, and of opening the driver, s."""
    pace = DevicePace()
    driver = driver_for(ModbusTcpDevice(port=port, reply_timeout_s=1.0, tls=tls))
    connect_s = []
    for _ in range(HANDSHAKES):
        start_s = time.perf_counter()
        driver.open()
        connect_s.append(time.perf_counter() - start_s)
    link = Link(driver, pace)
    held_pa, _ = link.open()
    recorder = Recorder(folder / "recordings", "v", 50_000_000, 2)
    cycle = Cycle(link, Controller(Settings.of(DAEMON), held_pa), pace, FIRST, recorder)
    recorder.start()
    words = COMMAND.format.encode(PUSH_PA)
    context = client_context(tls)
    context.check_hostname = False  # the bare client cannot
    with ModbusTlsClient("127.0.0.1", port=other_port, sslctx=context) as bare:
        ways = {
            "bare": lambda: bare.readwrite_registers(
                read_address=0, read_count=COMMAND.address, write_address=COMMAND.address, values=words
            ),
            "full": full_loop(cycle),
        }
        times = measured(ways, CYCLES)
    recorder.stop()
    link.release()
    return times, connect_s


@contextmanager
def slave(file: Path) -> Iterator[int]:
    """Run a simulated slave in lockstep, its certificates beside its file; give its port."""
    table = "authority = 'authority.pem'\ncertificate = 'device.pem'\nkey = 'device.key'\n"
    file.write_text(f"[clock]\nmode = 'lockstep'\n[sensor]\nnoise_std_m = 1e-5\n[bus.tls]\n{table}")
    command = [sys.executable, "-m", "positioner.cli", "sim", str(file), "--listen-port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield int(process.stdout.readline().rsplit(":", 1)[1])
        finally:
            process.terminate()


if __name__ == "__main__":
    print("\n".join(report()))

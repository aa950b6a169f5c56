"""One cycle over Modbus RTU on a pseudo-terminal pair: the daemon's full cycle against a bare pymodbus loop.

Both talk to simulated slaves of the same kind, processes of their own in lockstep. They take turns block by block: in
turns cycle by cycle, each would have its silence while the other works. A pseudo-terminal has no baud rate, so what is
timed is software and the silences of the specification: 1.75 ms before the request, which the bare client leaves out,
and 1.75 ms before the reply. Pymodbus looks for its reply every millisecond.
"""

import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pymodbus.client import ModbusSerialClient

from benchmarks.bus import COMMAND, PUSH_PA, measured, ratio
from benchmarks.cycle_time import DAEMON, FIRST, full_loop
from config.device import ModbusRtuDevice
from config.serial_port import Baud, SerialPort
from drivers import driver_for
from positioner.cli.parts.pseudo_line import pseudo_line
from positioner.control.controller import Controller
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace
from positioner.daemon.recorder import Recorder

BAUD: Baud = 115200
CYCLES, BLOCK = 1200, 20
TARGET_RATIO = 0.8


def report() -> list[str]:
    """Return lines: rates of the bare loop and the full cycle, their ratio, and what a real line would give."""
    with slave() as path, slave() as other_path, tempfile.TemporaryDirectory() as folder:
        pace = DevicePace()
        port = SerialPort(path=path, baud=BAUD)
        link = Link(driver_for(ModbusRtuDevice(serial=port, reply_timeout_s=1.0)), pace)
        held_pa, _ = link.open()
        recorder = Recorder(Path(folder), "v", 50_000_000, 2)
        cycle = Cycle(link, Controller(Settings.of(DAEMON), held_pa), pace, FIRST, recorder)
        recorder.start()
        words = COMMAND.format.encode(PUSH_PA)
        with ModbusSerialClient(other_path, baudrate=BAUD, parity="N", timeout=1.0, retries=0) as bare:
            ways = {
                "bare": lambda: bare.readwrite_registers(
                    read_address=0, read_count=COMMAND.address, write_address=COMMAND.address, values=words
                ),
                "full": full_loop(cycle),
            }
            times = measured(ways, CYCLES, warm_up=3 * BLOCK, block=BLOCK)
        recorder.stop()
        link.release()
    bare_us, full_us = (statistics.median(times[name]) for name in ("bare", "full"))
    characters = 17 + 5 + 2 * COMMAND.address
    line_s = characters * port.character_s + 2 * port.silence_s
    return [
        f"bare pymodbus RTU, function 23    {1e6 / bare_us:7.0f} cycles/s",
        f"the daemon's full cycle           {1e6 / full_us:7.0f} cycles/s",
        f"ratio                             {ratio(times['bare'], times['full'])}, target at least {TARGET_RATIO}",
        f"a real line of {BAUD} baud      {1 / line_s:7.0f} cycles/s at most: {characters} characters, two silences",
    ]


@contextmanager
def slave() -> Iterator[str]:
    """Run a simulated slave in lockstep on one end of a line; give the other end."""
    with tempfile.TemporaryDirectory() as folder, pseudo_line() as (end, other_end):
        file = Path(folder, "slave.toml")
        bus = f'[bus]\nkind = "rtu"\nserial = {{path = "{other_end}", baud = {BAUD}}}\n'
        file.write_text(f"{bus}[clock]\nmode = 'lockstep'\n[sensor]\nnoise_std_m = 1e-5\n")
        command = [sys.executable, "-m", "positioner.cli", "sim", str(file)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
            try:
                assert process.stdout is not None
                process.stdout.readline()
                yield end
            finally:
                process.terminate()


if __name__ == "__main__":
    print("\n".join(report()))

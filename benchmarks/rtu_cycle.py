"""One cycle over Modbus RTU on a pseudo-terminal pair: the daemon's full cycle against a bare pymodbus loop.

Both talk to simulated slaves of the same kind, processes of their own in lockstep. They take turns block by block: in
turns cycle by cycle, each would have its silence while the other works. A pseudo-terminal has no baud rate, so what is
timed is software and the silences of the specification: 1.75 ms before the request, which the bare client leaves out,
and 1.75 ms before the reply. Pymodbus looks for its reply every millisecond.
"""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pymodbus.client import ModbusSerialClient

from benchmarks.bus import COMMAND, measured, slave_process
from benchmarks.cycle_time import bare_loop, daemon_loop, rates
from config.device import ModbusRtuDevice
from config.serial_port import Baud, SerialPort
from drivers import driver_for
from positioner.cli.parts.pseudo_line import pseudo_line

BAUD: Baud = 115200
CYCLES, BLOCK = 1200, 20


def report() -> list[str]:
    """Return lines: rates of the bare loop and the full cycle, their ratio, and what a real line would give."""
    with slave() as path, slave() as other_path:
        port = SerialPort(path=path, baud=BAUD)
        with (
            daemon_loop(driver_for(ModbusRtuDevice(serial=port, reply_timeout_s=1.0))) as full,
            ModbusSerialClient(other_path, baudrate=BAUD, parity="N", timeout=1.0, retries=0) as bare,
        ):
            times = measured({"bare": bare_loop(bare), "full": full}, CYCLES, warm_up=3 * BLOCK, block=BLOCK)
    characters = 17 + 5 + 2 * COMMAND.address
    line_s = characters * port.character_s + 2 * port.silence_s
    return [
        *rates("pymodbus RTU", times["bare"], times["full"]),
        f"a real line of {BAUD} baud      {1 / line_s:7.0f} cycles/s at most: {characters} characters, two silences",
    ]


@contextmanager
def slave() -> Iterator[str]:
    """Run a simulated slave in lockstep on one end of a line; give the other end."""
    with tempfile.TemporaryDirectory() as folder, pseudo_line() as (end, other_end):
        bus = f'[bus]\nkind = "rtu"\nserial = {{path = "{other_end}", baud = {BAUD}}}\n'
        with slave_process(Path(folder, "slave.toml"), bus):
            yield end


if __name__ == "__main__":
    print("\n".join(report()))

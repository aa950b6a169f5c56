"""One cycle over Modbus TCP: what the driver adds to the bare client, and one client to another.

All talk to the same simulated slave, a process of its own in lockstep, on loopback. Machines are noisy and place
threads as they like, so the ways take turns cycle by cycle and what counts is the ratio within one run; what the
driver itself adds is timed inside its own cycles, as all that is not the client's call.
"""

import statistics
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from unittest import mock

from pymodbus.client import ModbusTcpClient

from config.device import ModbusTcpDevice
from config.modbus_map import SIMULATED_MAP
from drivers.modbus_tcp import ModbusTcpDriver
from fieldbus.modbus.client import ModbusClient
from positioner.testing.child_process import port_in

CYCLES, WARM_UP = 4000, 200
BLOCK, STRETCH = 50, 100
PUSH_PA = 60e3
ANY_PORT = ("--listen-port", "0")
SLAVE = "[clock]\nmode = 'lockstep'\n[sensor]\nnoise_std_m = 1e-5\n"
COMMAND = SIMULATED_MAP.command_pa


def report() -> list[str]:
    """Return lines: median and 99 % of a cycle by each way, its ratio to the bare client, and what the driver adds."""
    with slave() as port:
        with ModbusTcpClient("127.0.0.1", port=port) as independent:
            times = measured(ways(port, independent))
        added = driver_alone(port)
    bare = statistics.median(times["client, ready-made request"])
    lines = [f"{'one cycle, back to back':34}{'median us':>10}{'99 % us':>10}{'ratio':>8}"]
    for name, taken in times.items():
        middle, late = statistics.median(taken), statistics.quantiles(taken, n=100)[98]
        lines.append(f"{name:34}{middle:10.1f}{late:10.1f}{middle / bare:8.2f}")
    late = statistics.quantiles(added, n=100)[98]
    return [*lines, f"{'added by the driver, exchange()':34}{statistics.median(added):10.1f}{late:10.1f}"]


def ways(port: int, independent: ModbusTcpClient) -> dict[str, Callable[[], object]]:
    """Return one cycle by each way."""
    words = COMMAND.format.encode(PUSH_PA)
    count = COMMAND.address
    client = ModbusClient("127.0.0.1", port, 1, 1.0)
    client.open()
    driver = ModbusTcpDriver(ModbusTcpDevice(port=port, reply_timeout_s=1.0))
    driver.open()
    request = struct.pack(">BHHHHBf", 23, 0, count, COMMAND.address, 2, 4, PUSH_PA)

    def two_transactions() -> object:
        driver.write(PUSH_PA)
        return driver.read()

    return {
        "pymodbus's client, function 23": lambda: independent.readwrite_registers(
            read_address=0, read_count=count, write_address=COMMAND.address, values=words
        ),
        "client, ready-made request": lambda: client.transact(request),
        "driver, exchange()": lambda: driver.exchange(PUSH_PA),
        "driver, write() and read()": two_transactions,
    }


def measured(
    cycles: dict[str, Callable[[], object]], number: int = CYCLES, warm_up: int = WARM_UP, block: int = 1
) -> dict[str, list[float]]:
    """Return the times taken by each, in us; in turn, each for a block of cycles. `number` and `warm_up` are of cycles.

    Cycle by cycle, whatever a device still does behind its answer is done in another's time; in a block it counts.
    """
    times: dict[str, list[float]] = {name: [] for name in cycles}
    for _ in range((warm_up + number) // block):
        for name, cycle in cycles.items():
            for _ in range(block):
                start_ns = time.perf_counter_ns()
                cycle()
                times[name].append((time.perf_counter_ns() - start_ns) / 1e3)
    return {name: taken[-number:] for name, taken in times.items()}


@dataclass(frozen=True, slots=True)
class Ratio:
    """How often one way goes round while another does once: the middle of all stretches' ratios, and where half lie."""

    middle: float
    low: float
    high: float

    def __str__(self) -> str:
        return f"{self.middle:.2f} (half of the time {self.low:.2f} to {self.high:.2f})"


def ratio(over: Sequence[float], under: Sequence[float]) -> Ratio:
    """Return the ratio of two ways' times taken in turn, stretch by stretch, since machines are busy at times."""
    each = [
        statistics.median(over[start : start + STRETCH]) / statistics.median(under[start : start + STRETCH])
        for start in range(0, len(over), STRETCH)
    ]
    low, middle, high = statistics.quantiles(each, n=4)
    return Ratio(middle, low, high)


def driver_alone(port: int) -> list[float]:
    """Return the time of each exchange that is not the client's call, in us."""
    inside_ns = 0
    ask = ModbusClient.transact

    def timed(client: ModbusClient, pdu: bytes) -> bytes:
        nonlocal inside_ns
        start_ns = time.perf_counter_ns()
        reply = ask(client, pdu)
        inside_ns = time.perf_counter_ns() - start_ns
        return reply

    with mock.patch.object(ModbusClient, "transact", timed):
        driver = ModbusTcpDriver(ModbusTcpDevice(port=port, reply_timeout_s=1.0))
        driver.open()
        added = []
        for _ in range(WARM_UP + CYCLES):
            start_ns = time.perf_counter_ns()
            driver.exchange(PUSH_PA)
            added.append((time.perf_counter_ns() - start_ns - inside_ns) / 1e3)
        driver.close()
    return added[WARM_UP:]


@contextmanager
def slave() -> Iterator[int]:
    """Run a simulated slave in lockstep; give its port."""
    with tempfile.TemporaryDirectory() as folder, slave_process(Path(folder, "slave.toml"), "", *ANY_PORT) as ready:
        yield port_in(ready)


@contextmanager
def slave_process(file: Path, bus: str, *options: str) -> Iterator[str]:
    """Run a simulated slave in lockstep; give the line that says it is ready.

    Args:
        file: that it is given, written here.
        bus: tables of its bus.
        options: of its command line.
    """
    file.write_text(bus + SLAVE)
    command = [sys.executable, "-m", "positioner.cli", "sim", str(file), *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            ready = process.stdout.readline()
            if not ready:
                raise RuntimeError("the slave did not start")
            yield ready.strip()
        finally:
            process.terminate()


if __name__ == "__main__":
    print("\n".join(report()))

"""The supervisory port under floods from other hosts: the DCS is served, memory is bounded, the cycle goes on.

How much it costs the cycle is measured by `python -m benchmarks.flood`.
"""

import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from threading import Event, Thread

import pytest

from benchmarks.endurance import held_by
from config.codes import Fault
from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs
from tests.children import child, running
from tests.daemon_files import PATIENT, daemon_file, slave_file
from tests.waiting import until

pytestmark = pytest.mark.patient

CLIENTS = 200
MOST_GROWN_KB = 60_000
READ_ALL = bytes.fromhex("0001 0000 0006 01 03 0000 007d")
REFUSED = struct.pack(">HHHBBHH", 1, 0, 6, 1, 6, 100, 1)
SUPERVISORY = "[safety]\nstale_after_s = 10.0\n"
SITE = "reserved_hosts = ['127.0.0.1']\n"
"""The DCS calls from 127.0.0.1; everybody else from other addresses of the loopback, as other hosts would."""


def caller(port: int, number: int) -> socket.socket:
    """Return a connection from another host."""
    return socket.create_connection(("127.0.0.1", port), timeout=5.0, source_address=(f"127.0.1.{1 + number % 8}", 0))


def flood(port: int, number: int, stop: Event) -> None:
    """Ask without end and read it all."""
    with suppress(OSError), caller(port, number) as line:
        while not stop.is_set():
            line.sendall(20 * READ_ALL)
            line.recv(1 << 16)


def refused(port: int, number: int, stop: Event) -> None:
    """Write what is refused, without end."""
    with suppress(OSError), caller(port, number) as line:
        while not stop.is_set():
            line.sendall(20 * REFUSED)
            line.recv(1 << 16)


def deaf(port: int, number: int, stop: Event) -> None:
    """Ask for much and never read it."""
    with suppress(OSError), caller(port, number) as line:
        while not stop.is_set():
            line.sendall(500 * READ_ALL)


def slow(port: int, number: int, stop: Event) -> None:
    """Send a byte now and then, never a frame."""
    with suppress(OSError), caller(port, number) as line:
        while not stop.wait(0.2):
            line.sendall(b"\0")


def silent(port: int, number: int, stop: Event) -> None:
    """Connect and say nothing."""
    with suppress(OSError), caller(port, number):
        stop.wait()


def knocking(port: int, number: int, stop: Event) -> None:
    """Connect and hang up, without end."""
    while not stop.is_set():
        with suppress(OSError):
            caller(port, number).close()


RUDE: tuple[Callable[[int, int, Event], None], ...] = (flood, refused, deaf, slow, silent, knocking)


@contextmanager
def besieged(port: int, clients: int) -> Iterator[None]:
    """Have so many clients come, of all kinds."""
    stop = Event()
    threads = [
        Thread(target=RUDE[number % len(RUDE)], args=(port, number, stop), daemon=True) for number in range(clients)
    ]
    for each in threads:
        each.start()
    try:
        yield
    finally:
        stop.set()
        for each in threads:
            each.join(10.0)


@pytest.mark.long
def test_the_dcs_is_served_and_memory_is_bounded_whoever_else_comes(tmp_path: Path) -> None:
    with ExitStack() as stack:
        slave = stack.enter_context(running("sim", slave_file(tmp_path), "--listen-port", "0"))
        config = daemon_file(tmp_path, port_in(slave), SUPERVISORY, PATIENT)
        config.write_text(config.read_text().replace("[supervisory]\n", f"[supervisory]\n{SITE}"))
        process, ready = stack.enter_context(child("run", config))
        port = port_in(ready)
        with Dcs("127.0.0.1", port, timeout_s=30.0) as dcs:
            before_kb = held_by(process.pid)[0]
            with besieged(port, CLIENTS):
                cycles = dcs.get("cycles")
                until(lambda: dcs.get("cycles") > cycles + 300, "cycles")
                with Dcs("127.0.0.1", port, timeout_s=30.0) as another:
                    another.set("heartbeat", 7)
                assert (dcs.get("heartbeat"), dcs.get("fault")) == (7, Fault.NONE)
                grown_kb = held_by(process.pid)[0] - before_kb
        assert grown_kb < MOST_GROWN_KB
    assert config.with_suffix(".log").stat().st_size < 1_000_000

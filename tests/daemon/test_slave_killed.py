"""kill -9 of the slave while the stem moves (S1), on each bus: seen within 3 cycles, the defined state, recovery.

The daemon's cycle runs here, on a slave process in real time; its cycles are counted, not timed.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from config.canopen_device import CanopenDevice
from config.codes import Fault, Mode, Quality, State
from config.daemon_file import DaemonFile
from config.device import ModbusRtuDevice, ModbusTcpDevice
from config.serial_port import SerialPort
from drivers import driver_for
from positioner.cli.parts.pseudo_line import pseudo_line
from positioner.control.controller import Controller
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import RealTimePace
from tests.certificates import folder, tls
from tests.children import Child, child

pytestmark = pytest.mark.real_time

STROKE_M = 0.1016
MOST_CYCLES = 3000
PATIENT_S = 1.0
"""Until a measurement is stale: a machine that pauses for less changes nothing of what is counted here."""
LAW = {"b_over_c_pa_per_m": -814542.6, "k_over_c_pa": -22068.2}
AT_REST = "[sensor]\nnoise_std_m = 1e-5\n[initial]\nposition_m = 0.03\npressure_pa = 24000.0\n"


@dataclass
class Wire:
    """How a slave is put on a bus, and the daemon's device there once it is."""

    slave: Callable[[int | None], str]
    """Table `[bus]`; with the port it had before, if it is to come back there."""
    device: Callable[[str], ModbusTcpDevice | ModbusRtuDevice | CanopenDevice]
    """From what the slave says when it listens."""


def port_of(ready: str) -> int:
    return int(ready.rpartition(":")[2])


def tcp(secured: bool) -> Wire:
    shown = folder()
    table = (
        f'tls = {{authority = "{shown}/authority.pem", certificate = "{shown}/device.pem", key = "{shown}/device.key"}}'
    )
    return Wire(
        lambda port: f"port = {port or 5020}\n{table if secured else ''}\n",
        lambda ready: ModbusTcpDevice(
            port=port_of(ready), reply_timeout_s=0.5, tls=tls("daemon", handshake_timeout_s=2.0) if secured else None
        ),
    )


def canopen() -> Wire:
    return Wire(
        lambda port: f'kind = "canopen"\nchannel = "{port or 29500}"\n',
        lambda ready: CanopenDevice(channel=str(port_of(ready)), reply_timeout_s=0.5, heartbeat_s=1.0),
    )


@contextmanager
def wire_of(bus: str) -> Iterator[Wire]:
    if bus == "canopen":
        yield canopen()
        return
    if bus != "rtu":
        yield tcp(secured=bus == "tls")
        return
    with pseudo_line() as (end, other_end):
        yield Wire(
            lambda _: f'kind = "rtu"\nserial = {{path = "{other_end}", baud = 115200}}\n',
            lambda _: ModbusRtuDevice(serial=SerialPort(path=end, baud=115200), reply_timeout_s=0.5),
        )


@contextmanager
def slave(path: Path, table: str, *options: str) -> Iterator[tuple[Child, str]]:
    path.write_text(f"[bus]\n{table}{AT_REST}")
    with child("sim", path, *options) as (process, ready):
        assert ready.startswith("listening on ")
        yield process, ready


def cycles_until(cycle: Cycle, holds: Callable[[], bool], what: str, most: int = MOST_CYCLES) -> int:
    """Run cycles until something holds; return how many it took."""
    for number in range(1, most + 1):
        cycle.once()
        if holds():
            return number
    raise AssertionError(f"{what} did not come within {most} cycles: {cycle.snapshot}")


@pytest.mark.parametrize("bus", ["modbus", "tls", "rtu", "canopen"])
def test_a_slave_killed_in_s1_is_a_fault_within_3_cycles_and_is_taken_up_again(bus: str, tmp_path: Path) -> None:
    tables = {
        "valve": {"stroke_m": STROKE_M},
        "law": LAW,
        "safety": {"stale_after_s": PATIENT_S},
        "control": {"law": "seed"},
    }
    file = DaemonFile.model_validate(tables)
    with wire_of(bus) as wire:
        with slave(tmp_path / "slave.toml", wire.slave(None), *(() if bus == "rtu" else ("--listen-port", "0"))) as (
            process,
            ready,
        ):
            pace = RealTimePace(file.cycle.period_s)
            link = Link(driver_for(wire.device(ready)), pace)
            held_pa, _ = link.open()
            cycle = Cycle(link, Controller(Settings.of(file), held_pa), pace, Requests(), None)
            cycle.requests = replace(
                cycle.requests, mode=Mode.AUTOMATIC, mode_writes=1, reference_m=0.6 * STROKE_M, reference_writes=1
            )
            cycles_until(cycle, lambda: cycle.snapshot.decision.state is State.S1_UP, "S1")
            commanded_pa = cycle.snapshot.decision.command_pa
            process.kill()
        took = cycles_until(cycle, lambda: cycle.snapshot.decision.fault is Fault.NO_REPLY, "the fault")
        assert took <= file.safety.lost_after_cycles == 3
        for _ in range(took, file.safety.lost_after_cycles):  # a slow line is dead sooner: then it was away for longer
            cycle.once()
        decision = cycle.snapshot.decision
        assert (decision.mode, decision.command_pa) == (Mode.HOLD, commanded_pa), "the safe action, hold"
        assert cycle.snapshot.sample.quality is Quality.LOST

        with slave(tmp_path / "slave.toml", wire.slave(port_of(ready) if bus != "rtu" else None)):
            cycles_until(cycle, lambda: cycle.snapshot.decision.fault is Fault.RESTARTED, "its being another's command")
            assert cycle.snapshot.decision.command_pa == pytest.approx(24000.0), "it is held, not moved"
            cycle.requests = replace(cycle.requests, acknowledgements=1)
            cycles_until(cycle, lambda: cycle.snapshot.decision.fault is Fault.NONE, "the acknowledgement")
            cycle.requests = replace(cycle.requests, mode=Mode.AUTOMATIC, mode_writes=2, reference_writes=2)
            cycles_until(cycle, lambda: cycle.snapshot.decision.state is State.S1_UP, "S1 again")
        link.release()

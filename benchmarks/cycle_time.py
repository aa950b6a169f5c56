"""The daemon's full cycle against a bare pymodbus loop on the same slave, and the control core alone.

Full cycle: sample to command on the wire, with supervision, states, law, estimation, publishing and recording. The
slave is a process of its own in lockstep; the ways take turns cycle by cycle, so the ratio holds on a noisy machine and
each begins, as in real time, with the caches of others' work. Half of the time the daemon identifies.
"""

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from pymodbus.client import ModbusTcpClient
from pymodbus.client.base import ModbusBaseSyncClient

from benchmarks.bus import COMMAND, PUSH_PA, measured, ratio, slave
from config.codes import Mode, State
from config.daemon_file import DaemonFile
from config.device import ModbusTcpDevice
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from drivers import driver_for
from drivers.boundary import Driver
from positioner.control.controller import Controller
from positioner.control.requests import QUIET, Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace
from positioner.daemon.recorder import Recorder
from positioner.daemon.snapshot import Snapshot
from positioner.virtual.virtual_cycle import Script, play_script, virtual_cycle
from sim.slave.slave import device_of

STROKE_M = 0.1016
DAEMON = DaemonFile.model_validate(
    {"valve": {"stroke_m": STROKE_M}, "cycle": {"pace": "device"}, "control": {"law": "seed"}}
)
FIRST = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=44e3, beta_pa=13e3)
TURN_S, RUN_S = 1.0, 8.0
TARGET_RATIO = 0.8


def report() -> list[str]:
    """Return lines: rates of the bare loop and the full cycle, their ratio, and the core's processor time a step."""
    bare_us, full_us = full_cycle()
    core_us = core_alone()
    return [
        *rates("pymodbus", bare_us, full_us),
        *(
            f"control core alone, {name:14}{statistics.fmean(each):7.1f} us a step on average, median "
            f"{statistics.median(each):.1f}, 99 % {sorted(each)[int(0.99 * len(each))]:.1f}"
            for name, each in core_us.items()
        ),
    ]


def busy_dcs() -> Script:
    """Identify for a second, step for a second, and so on: what a working daemon does, and more of it.

    It writes when something changes, as a DCS does: its writes are no part of the cycle's work.
    """

    def ask(snapshot: Snapshot, requests: Requests) -> Requests:
        turn = int(snapshot.sample.time_s / TURN_S)
        if turn % 2 == 0:
            return requests if requests.eta == (0, 0, 0) else replace(requests, eta=(0, 0, 0))
        reference_m = (0.65 if turn % 4 == 1 else 0.4) * STROKE_M
        if (requests.eta, requests.reference_m) == (QUIET, reference_m):
            return requests
        new = requests.reference_m != reference_m
        return replace(
            requests, eta=QUIET, reference_m=reference_m, reference_writes=requests.reference_writes + int(new)
        )

    return ask


def full_cycle() -> tuple[list[float], list[float]]:
    """Return the times of bare and full cycles, us."""
    with (
        slave() as port,
        slave() as other_port,
        daemon_loop(driver_for(ModbusTcpDevice(port=port, reply_timeout_s=1.0))) as full,
        ModbusTcpClient("127.0.0.1", port=other_port) as bare,
    ):
        times = measured({"bare": bare_loop(bare), "full": full})
    return times["bare"], times["full"]


def rates(protocol: str, bare_us: Sequence[float], full_us: Sequence[float]) -> list[str]:
    """Return lines: cycles a second of the bare loop and of the full cycle, and their ratio."""
    return [
        f"{f'bare {protocol}, function 23':34}{1e6 / statistics.median(bare_us):7.0f} cycles/s",
        f"the daemon's full cycle           {1e6 / statistics.median(full_us):7.0f} cycles/s",
        f"ratio                             {ratio(bare_us, full_us)}, target at least {TARGET_RATIO}",
    ]


def bare_loop(client: ModbusBaseSyncClient) -> Callable[[], object]:
    """Return one cycle of a loop that only talks."""
    words = COMMAND.format.encode(PUSH_PA)
    return lambda: client.readwrite_registers(
        read_address=0, read_count=COMMAND.address, write_address=COMMAND.address, values=words
    )


@contextmanager
def daemon_loop(driver: Driver) -> Iterator[Callable[[], object]]:
    """Give one cycle of the daemon on a device, its DCS and recorder included."""
    pace = DevicePace()
    link = Link(driver, pace)
    held_pa, _ = link.open()
    with tempfile.TemporaryDirectory() as folder:
        recorder = Recorder(Path(folder), "v", 50_000_000, 2)
        cycle = Cycle(link, Controller(Settings.of(DAEMON), held_pa), pace, FIRST, recorder)
        recorder.start()
        yield full_loop(cycle)
        recorder.stop()
    link.release()


def full_loop(cycle: Cycle) -> Callable[[], object]:
    """Return one cycle of the daemon, its DCS included."""
    script = busy_dcs()

    def once() -> None:
        cycle.requests = script(cycle.snapshot, cycle.requests)
        cycle.once()

    return once


def core_alone() -> dict[str, list[float]]:
    """Return what each step of the control core takes on the samples of a virtual run, us: in S3, and under a law."""
    controller = Controller(Settings.of(DAEMON), 0.0)
    core_us: dict[str, list[float]] = {"in S3": [], "under the law": []}
    for sample, requests in virtual_run():
        start_ns = time.thread_time_ns()
        identifies = controller.step(sample, requests).state is State.S3_IDENTIFY
        core_us["in S3" if identifies else "under the law"].append((time.thread_time_ns() - start_ns) / 1e3)
    return core_us


def core_again(inputs: Sequence[tuple[Sample, Requests]]) -> None:
    """Let a control core that knows nothing yet decide on all samples of a virtual run."""
    controller = Controller(Settings.of(DAEMON), 0.0)
    for sample, requests in inputs:
        controller.step(sample, requests)


def virtual_run() -> list[tuple[Sample, Requests]]:
    """Run the daemon's cycle on a device in memory for `RUN_S`; return what its control core was given."""
    file = SlaveFile.model_validate({"clock": {"mode": "lockstep"}, "sensor": {"noise_std_m": 1e-5}})
    cycle = virtual_cycle(DAEMON, device_of(file, shipped_valve("seed")), FIRST)
    script = busy_dcs()
    seen: list[tuple[Sample, Requests]] = []

    def noting(snapshot: Snapshot, requests: Requests) -> Requests:
        seen.append((snapshot.sample, requests))
        return script(snapshot, requests)

    for _ in play_script(cycle, noting, RUN_S):
        pass
    return seen


if __name__ == "__main__":
    print("\n".join(report()))

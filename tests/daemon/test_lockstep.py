"""The daemon's cycle in lockstep with a slave process over real TCP: the same run twice is the same bit by bit."""

import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from config.codes import Mode
from config.daemon_file import DaemonFile
from config.device import ModbusTcpDevice
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from drivers import driver_for
from positioner.cli.parts.children import port_in
from positioner.control.controller import Controller
from positioner.control.requests import QUIET, Requests
from positioner.control.settings import Settings
from positioner.daemon.cycle import Cycle
from positioner.daemon.link import Link
from positioner.daemon.pacing import DevicePace
from positioner.daemon.recorder import Recorder
from positioner.daemon.snapshot import Snapshot
from positioner.estimation.refiner import InProcessRefiner
from positioner.virtual.virtual_cycle import play_script, virtual_cycle
from sim.slave.slave import device_of
from tests.children import running

STROKE_M = 0.1016
SLAVE = '[clock]\nmode = "lockstep"\nperiod_s = 1e-3\n[sensor]\nnoise_std_m = 1e-5\nseed = 4\n'
DAEMON = DaemonFile.model_validate(
    {"valve": {"stroke_m": STROKE_M}, "cycle": {"pace": "device"}, "control": {"law": "seed"}}
)
EXCITED = Requests(mode=Mode.AUTOMATIC, mode_writes=1, alpha_pa=44e3, beta_pa=13e3)


def dcs(snapshot: Snapshot, requests: Requests) -> Requests:
    """Identify for a second, then step up and down; told by the device's clock alone."""
    time_s = snapshot.sample.time_s
    if time_s < 1.0:
        return replace(requests, eta=(0, 0, 0))
    up = time_s < 1.4
    return replace(requests, eta=QUIET, reference_m=(0.6 if up else 0.4) * STROKE_M, reference_writes=1 if up else 2)


def recorded(folder: Path) -> list[str]:
    folder.mkdir()
    (folder / "slave.toml").write_text(SLAVE)
    with running("sim", folder / "slave.toml", "--listen-port", "0") as slave:
        pace = DevicePace()
        link = Link(driver_for(ModbusTcpDevice(port=port_in(slave), reply_timeout_s=5.0)), pace)
        held_pa, _ = link.open()
        recorder = Recorder(folder / "recordings", "v", 10_000_000, 2)
        cycle = Cycle(link, Controller(Settings.of(DAEMON), held_pa, InProcessRefiner()), pace, EXCITED, recorder)
        recorder.start()
        for _ in play_script(cycle, dcs, 1.8):
            pass
        recorder.stop()
        link.release()
    (path,) = (folder / "recordings").iterdir()
    return [line for line in path.read_text().splitlines() if not line.startswith("#")]


@pytest.fixture(scope="module")
def over_tcp(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    return recorded(tmp_path_factory.mktemp("lockstep") / "first")


def test_two_runs_give_the_same_recording_bit_by_bit(over_tcp: list[str], tmp_path: Path) -> None:
    assert len(over_tcp) > 1800
    assert over_tcp == recorded(tmp_path / "second")
    states = {int(line.split(",")[5]) for line in over_tcp[1:]}
    assert states >= {1, 2, 3}


def test_the_bus_changes_nothing_but_float32_rounding(over_tcp: list[str]) -> None:
    """The same device in memory: what the wire rounds is all that differs."""
    slave = SlaveFile.model_validate(tomllib.loads(SLAVE))
    cycle = virtual_cycle(DAEMON, device_of(slave, shipped_valve("seed")), EXCITED)
    in_memory = [snapshot.sample.position_m for snapshot in play_script(cycle, dcs, 1.8)]
    measured_m = [float(line.split(",")[2]) for line in over_tcp[1:]]
    assert len(in_memory) == len(measured_m)
    assert max(abs(a - b) for a, b in zip(in_memory, measured_m, strict=True)) < 1e-6

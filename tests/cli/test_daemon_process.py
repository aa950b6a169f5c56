"""The daemon as a process against a slave as a process: registers on the wire, faults, safe states, recovery."""

import re
import signal
import socket
import struct
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

import pytest

from config.codes import Fault, Mode
from config.device import ModbusTcpDevice
from config.recording import read_recording
from config.registers import BY_NAME
from drivers import driver_for
from drivers.boundary import Driver
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs, DcsError
from tests.children import child, ended, running
from tests.daemon_files import PATIENT, daemon_file, slave_file
from tests.independent import independent_client, refused_with
from tests.waiting import until

pytestmark = pytest.mark.real_time

STOPS = 8
"""Of a daemon, of which one is not just before a command is sent."""


@pytest.fixture(scope="module")
def lone_slave(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Run a slave that nobody commands yet; give its port."""
    with running("sim", slave_file(tmp_path_factory.mktemp("slave")), "--listen-port", "0") as ready:
        yield port_in(ready)


@pytest.mark.parametrize(
    ("number", "action", "left_pa"),
    [
        (signal.SIGTERM, "hold", 24000.0),
        (signal.SIGINT, "hold", 24000.0),
        (signal.SIGTERM, "vent", 0.0),
        (signal.SIGINT, "fill", 420e3),
        (signal.SIGHUP, "vent", 0.0),
        (signal.SIGQUIT, "fill", 420e3),
        (signal.SIGUSR1, "vent", 0.0),
    ],
)
def test_the_end_leaves_the_valve_in_the_safe_state(
    lone_slave: int, tmp_path: Path, number: signal.Signals, action: str, left_pa: float
) -> None:
    with watcher(lone_slave) as before:
        before.write(24000.0)
    path = daemon_file(tmp_path, lone_slave, f'[safety]\naction = "{action}"\n', PATIENT)
    with child("run", path) as (daemon, _):
        daemon.signal(number)
        status, _, log = daemon.ended()
    assert status == 0, log
    assert "Traceback" not in log
    with watcher(lone_slave) as after:
        assert after.open() == pytest.approx(left_pa), "what it was commanded last"


def test_a_daemon_that_was_stopped_finds_what_the_device_did_and_does_not_undo_it(tmp_path: Path) -> None:
    """In automatic, stopped for longer than the device's time-out: the device has vented, and stays so.

    A command that the daemon is stopped just before sending goes out late, and undoes it: then once more. A busy
    machine is late by itself: what it latches is acknowledged, as by an operator.
    """
    device = 'communication_timeout_s = 0.4\ncommunication_action = "vent"\n'
    with (
        running("sim", slave_file(tmp_path), "--listen-port", "0") as slave,
        child("run", daemon_file(tmp_path, port_in(slave), device=PATIENT + device, period_s=0.05)) as (daemon, ready),
        Dcs("127.0.0.1", port_in(ready)) as dcs,
        watcher(port_in(slave)) as eye,
    ):

        def at_the_reference() -> bool:
            if dcs.get("fault"):
                dcs.set("acknowledge", 1)
            elif dcs.get("mode") != Mode.AUTOMATIC:
                with suppress(DcsError):  # a fault came between
                    dcs.set("mode", Mode.AUTOMATIC)
                    dcs.set("reference", 0.5)
            return not dcs.get("fault") and abs(dcs.get("position") - 0.5) < 0.05

        def stalled() -> bool:
            return dcs.get_all("fault", "mode") == {"fault": Fault.STALLED, "mode": Mode.HOLD}

        for _ in range(STOPS):
            until(at_the_reference, "the stem at the reference")
            daemon.signal(signal.SIGSTOP)
            until(lambda: eye.read().position_m < 0.4 * 0.1016, "the device's own time-out")
            daemon.signal(signal.SIGCONT)
            # The fault reads so before the first cycle, too.
            until(stalled, "the fault")
            cycles = dcs.get("cycles") + 10
            while dcs.get("cycles") < cycles:
                time.sleep(0.01)
            if eye.open() == 0.0:
                break
        assert eye.open() == dcs.get("command") == 0.0, "it holds what the device chose"
        assert eye.read().position_m < 0.4 * 0.1016
        daemon.signal(signal.SIGTERM)
        assert '"event": "the daemon stood still"' in daemon.ended().log


@contextmanager
def watcher(device_port: int) -> Iterator[Driver]:
    """Talk to the device itself, and leave what it does in silence as it is."""
    device = ModbusTcpDevice(port=device_port, reply_timeout_s=2.0)
    driver = driver_for(device.model_copy(update={"map": device.map.model_copy(update=UNTOUCHED)}))
    driver.open()
    try:
        yield driver
    finally:
        driver.close()


UNTOUCHED = {"communication_timeout_s": None, "communication_action": None}


def test_a_device_that_dies_is_a_fault_and_is_taken_up_again_without_a_move(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with ExitStack() as daemon:
        with running("sim", slave_file(tmp_path), "--listen-port", "0") as slave:
            device_port = port_in(slave)
            port = port_in(daemon.enter_context(running("run", daemon_file(tmp_path, device_port))))
        dcs = daemon.enter_context(Dcs("127.0.0.1", port))
        until(lambda: dcs.get("fault") == Fault.NO_REPLY, "the fault")
        assert dcs.get_all("mode", "quality") == {"mode": Mode.HOLD, "quality": 2}
        with running("sim", slave_file(tmp_path, device_port)):
            until(lambda: dcs.get("quality") == 0, "good measurements")
            assert dcs.get("fault") != Fault.NONE, "latched"
            with pytest.raises(
                DcsError, match=r"mode = 2 was refused: a fault is latched \(no reply\): .* acknowledge 1"
            ):
                dcs.set("mode", Mode.AUTOMATIC)
            assert main(["get", "fault", "quality", "position_m", "--port", str(port)]) == 0
            printed = capsys.readouterr().out
            assert re.fullmatch(r"fault +1 no reply\nquality +[01] (good|repeated)\nposition_m +0\.0\d+ m\n", printed)
            dcs.set("acknowledge", 1)
            until(lambda: dcs.get("fault") == Fault.NONE, "the acknowledgement")
            assert dcs.get("command") == pytest.approx(24000.0)
            assert dcs.get("position_m") == pytest.approx(0.03, abs=1e-4)


@dataclass
class Site:
    """A slave and a daemon that run."""

    device_port: int
    port: int
    folder: Path


@contextmanager
def site(folder: Path, more: str) -> Iterator[Site]:
    with running("sim", slave_file(folder), "--listen-port", "0") as slave:
        device_port = port_in(slave)
        with running("run", daemon_file(folder, device_port, more, PATIENT)) as daemon:
            yield Site(device_port, port_in(daemon), folder)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with site(tmp_path_factory.mktemp("site"), '[recorder]\nfolder = "recordings"\n') as here:
        yield here


def test_an_independent_client_reads_and_writes_the_registers_as_the_map_says(shared: Site) -> None:
    with independent_client(shared.port) as client:
        assert client.read_input(BY_NAME["float_test"].address, 2) == words_of(">f", 1234.5)
        assert client.read_holding(BY_NAME["long_test"].address, 2) == [0x1234, 0x5678]
        words = words_of(">f", 0.25)
        client.write(BY_NAME["reference"].address, words)
        assert client.read_holding(0, 3) == [*words, 2500]
        for bad in (float("nan"), 1.5, -0.1):
            with refused_with(3):
                client.write(0, words_of(">f", bad))
        assert client.read_holding(0, 2) == words, "nothing changed"


def words_of(layout: str, value: float) -> list[int]:
    packed = struct.pack(layout, value)
    return list(struct.unpack(f">{len(packed) // 2}H", packed))


def test_it_holds_the_pressure_it_found_and_moves_only_when_told(shared: Site) -> None:
    with Dcs("127.0.0.1", shared.port) as dcs:
        before = dcs.get_all("command", "position", "mode", "cycles")
        assert before["command"] == pytest.approx(24000.0)
        assert before["mode"] == Mode.HOLD
        dcs.set("reference", 0.6)
        until(lambda: dcs.get("cycles") > before["cycles"] + 100, "cycles")
        assert dcs.get("position") == pytest.approx(before["position"], abs=1e-3)
        dcs.set("mode", Mode.AUTOMATIC)
        until(lambda: abs(dcs.get("position") - 0.6) < 0.005, "the stem at the reference")
        dcs.set("mode", Mode.HOLD)


def test_what_it_did_is_on_record(shared: Site) -> None:
    with Dcs("127.0.0.1", shared.port) as dcs:
        cycles = dcs.get("cycles")
        (path,) = (shared.folder / "recordings").glob("FV-101-*.csv")
        until(lambda: len(path.read_text().splitlines()) > 0.5 * cycles, "the recording")
    recording = read_recording(path)
    assert recording.columns["pressure_pa"][0] == pytest.approx(24000.0)
    assert (recording.columns["unrecorded"] == 0).all()


def test_rude_clients_do_not_touch_the_cycle(shared: Site) -> None:
    """One never reads its answers, one stops in mid-frame, one vanishes, four write at once; the cycle goes on."""
    read_all = bytes.fromhex("0001 0000 0006 01 03 0000 007d")
    with ExitStack() as clients, Dcs("127.0.0.1", shared.port) as dcs:
        deaf, slow, gone = (clients.enter_context(socket.create_connection(("127.0.0.1", shared.port))) for _ in "123")
        deaf.sendall(read_all * 2000)
        slow.sendall(read_all[:5])
        gone.sendall(read_all)
        gone.close()
        before = dcs.get_all("cycles", "lost_replies", "fault")
        with ThreadPoolExecutor(4) as writers:
            list(writers.map(lambda beat: write_heartbeats(shared.port, beat), range(4)))
        until(lambda: dcs.get("cycles") > before["cycles"] + 500, "cycles")
        assert dcs.get_all("lost_replies", "fault") == {name: before[name] for name in ("lost_replies", "fault")}


def write_heartbeats(port: int, beat: int) -> None:
    with Dcs("127.0.0.1", port) as dcs:
        for _ in range(100):
            dcs.set("heartbeat", beat)


def test_a_killed_daemon_leaves_a_whole_recording(shared: Site, tmp_path: Path) -> None:
    path = daemon_file(tmp_path, shared.device_port, '[recorder]\nfolder = "recordings"\n', PATIENT)
    with child("run", path) as (daemon, _):
        until(
            lambda: sum(each.stat().st_size for each in (tmp_path / "recordings").glob("*.csv")) > 20_000, "recording"
        )
        daemon.kill()
    (recording,) = (tmp_path / "recordings").glob("*.csv")
    read = read_recording(recording)
    assert len(read) > 200
    # A kill may cut a write at a page's end: at most the last line is torn, left out, and said to be.
    assert read.metadata.get("torn", "the last line").startswith("the last line")


def test_a_port_in_use_is_one_line(shared: Site, tmp_path: Path) -> None:
    path = daemon_file(tmp_path, shared.device_port)
    path.write_text(path.read_text().replace("[supervisory]\nport = 0", f"[supervisory]\nport = {shared.port}"))
    done = ended("run", path)
    assert done.status == 2
    assert done.log == f"positioner run: 127.0.0.1:{shared.port}: cannot listen there: Address already in use\n"


def test_a_wrong_map_is_one_line(shared: Site, tmp_path: Path) -> None:
    """The sample counter taken for a position: its words are no float that a stem could be at."""
    path = daemon_file(
        tmp_path,
        shared.device_port,
        "[device.map]\nposition_m = {address = 0, type = 'uint16'}\ncommand_pa = {address = 11}\n",
    )
    done = ended("run", path)
    assert done.status == 2
    assert done.log.count("\n") == 1
    assert "device.map.position_m: the device says" in done.log

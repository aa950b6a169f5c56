"""Daemon and slave as processes on a CAN bus: the node killed and back, a second node on the bus, probe and doctor."""

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import datetime
from pathlib import Path

import pytest

from config.codes import Fault, Mode
from fieldbus.canopen.loopback import free_channel
from positioner.cli import doctor
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs, DcsError
from sim.slave import canopen_slave
from tests.children import Child, child, running
from tests.daemon_files import LAW
from tests.waiting import until

pytestmark = pytest.mark.real_time

NODE = 5
PATIENT = "reply_timeout_s = 2.0\nheartbeat_s = 1.0\n"
"""Where time is no matter, so that a busy machine is none."""


def slave_file(folder: Path, channel: str, node: int = NODE, more: str = "") -> Path:
    path = folder / f"slave{node}.toml"
    path.write_text(
        f'[bus]\nkind = "canopen"\nchannel = "{channel}"\nnode = {node}\n'
        f"[sensor]\nnoise_std_m = 1e-5\n[initial]\nposition_m = 0.03\npressure_pa = 24000.0\n{more}"
    )
    return path


def daemon_file(folder: Path, channel: str, node: int = NODE, more: str = "") -> Path:
    path = folder / f"daemon{node}.toml"
    path.write_text(
        f"[valve]\nname = 'FV-{node}'\nstroke_m = 0.1016\n"
        f'[device]\nbus = "canopen"\nchannel = "{channel}"\nnode = {node}\n{more}'
        f"[cycle]\nperiod_s = 4e-3\n[supervisory]\nport = 0\n{LAW}"
    )
    return path


@contextmanager
def slave(config: Path) -> Iterator[Child]:
    with child("sim", config) as (process, ready):
        assert ready.startswith("listening on loopback node")
        yield process


def automatic(dcs: Dcs) -> None:
    """Give the valve to the controller, also when a busy machine made it let go before."""

    def accepted() -> bool:
        dcs.set("acknowledge", 1)
        try:
            dcs.set("mode", Mode.AUTOMATIC)
        except DcsError:
            return False
        return True

    until(accepted, "automatic mode")


def events(log: Path) -> list[dict[str, object]]:
    return [json.loads(line) for line in log.read_text().splitlines()]


def faulted_s(log: Path, fault: str) -> list[float]:
    """Return when decisions named a fault, as seconds of the wall clock."""
    return [
        datetime.fromisoformat(str(event["time"])).timestamp()
        for event in events(log)
        if event["event"] == "decision" and event["fault"] == fault
    ]


def in_s1(dcs: Dcs, reference: float) -> None:
    """Have the stem move up, also when a busy machine made the controller let go meanwhile."""

    def is_there() -> bool:
        if dcs.get("mode") != Mode.AUTOMATIC:
            automatic(dcs)
            dcs.set("reference", 0.3)
            dcs.set("reference", reference)
        return dcs.get("state") == 1

    until(is_there, "S1")


def test_a_node_killed_while_the_stem_moves_is_a_fault_with_its_reason(tmp_path: Path) -> None:
    """How soon, what becomes of the valve, and how it comes back: tests/daemon/test_slave_killed.py, in cycles."""
    channel = free_channel()
    node, config, log = slave_file(tmp_path, channel), daemon_file(tmp_path, channel), tmp_path / f"daemon{NODE}.log"
    with slave(node) as process, running("run", config) as daemon, Dcs("127.0.0.1", port_in(daemon)) as dcs:
        in_s1(dcs, 0.6)
        process.kill()
        until(lambda: bool(faulted_s(log, "NO_REPLY")), "the fault")
        until(lambda: dcs.get("mode") == Mode.HOLD, "hold")
    reasons = {str(event["reason"]) for event in events(log) if event["event"] == "no good reply"}
    assert reasons
    assert all("no node answers" in each or "SYNC not answered" in each or "heartbeat lost" in each for each in reasons)
    assert any("no node answers" not in each for each in reasons), "what it was, before nobody was found"


def test_two_nodes_on_one_bus_each_have_their_daemon(tmp_path: Path) -> None:
    channel = free_channel()
    with ExitStack() as stack:
        ports = {}
        for node in (NODE, NODE + 1):
            stack.enter_context(slave(slave_file(tmp_path, channel, node)))
            own_sync = f"sync_cob_id = {0x680 + node}\n{PATIENT}"
            ports[node] = port_in(stack.enter_context(running("run", daemon_file(tmp_path, channel, node, own_sync))))
        one, other = (stack.enter_context(Dcs("127.0.0.1", port)) for port in ports.values())
        automatic(one)
        one.set("reference", 0.6)
        until(lambda: abs(one.get("position") - 0.6) < 0.01, "the stem of one at its reference")
        assert other.get("position") == pytest.approx(0.03 / 0.1016, abs=0.01), "the other has not moved"
        until(lambda: other.get("cycles") > 100, "cycles of the other")
        assert (one.get("fault"), other.get("fault")) == (Fault.NONE, Fault.NONE)


def test_probe_and_doctor_watch_a_node_that_a_daemon_drives(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(doctor, "PERIODS", 50)
    channel = free_channel()
    config = daemon_file(tmp_path, channel, more=PATIENT)
    with (
        slave(slave_file(tmp_path, channel)),
        running("run", config) as daemon,
        Dcs("127.0.0.1", port_in(daemon)) as dcs,
    ):
        assert main(["probe", str(config), "--count", "2"]) == 0
        assert capsys.readouterr().out.count("plausible") == 2
        main(["doctor", str(config)])
        (bus,) = (line for line in capsys.readouterr().out.splitlines() if line.startswith("bus"))
        assert bus.split()[1] == "ok", bus
        assert dcs.get("fault") == Fault.NONE
        assert dcs.get("lost_replies") == 0, "the watcher did not touch the daemon's bus"


def test_a_taken_node_id_and_bad_files_are_one_line_and_status_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(canopen_slave, "LISTEN_S", 100.0)  # the first answers when a busy machine lets it
    channel = free_channel()
    first = slave_file(tmp_path, channel)
    (tmp_path / "sheet.eds").write_text("not a data sheet")
    (tmp_path / "bad.toml").write_text('[valve]\nstroke_m = 0.1\n[device]\nbus = "canopen"\neds = "sheet.eds"\n')
    (tmp_path / "none.toml").write_text('[valve]\nstroke_m = 0.1\n[device]\nbus = "canopen"\neds = "none.eds"\n')
    (tmp_path / "gone.toml").write_text(f'[valve]\nstroke_m = 0.1\n[device]\nbus = "canopen"\nchannel = "{channel}"\n')
    (tmp_path / "face.toml").write_text('[valve]\nstroke_m = 0.1\n[device]\nbus = "canopen"\ninterface = "nosuch"\n')
    lines = {
        ("sim", first): "bus.node: 5 is taken",
        ("run", tmp_path / "bad.toml"): "is not an electronic data sheet",
        ("run", tmp_path / "none.toml"): "none.eds: cannot be read: No such file",
        ("run", tmp_path / "gone.toml"): "node 1: no node answers",
        ("run", tmp_path / "face.toml"): "nosuch",
    }
    with slave(first):
        for (command, config), line in lines.items():
            assert main([command, str(config)]) == 2
            said = capsys.readouterr()
            assert (said.out, said.err.count("\n")) == ("", 1), said.err
            assert line in said.err


def test_without_the_packages_a_gateway_runs_and_says_in_one_line_what_is_missing(tmp_path: Path) -> None:
    (tmp_path / "daemon.toml").write_text('[valve]\nstroke_m = 0.1\n[device]\nbus = "canopen"\n')
    (tmp_path / "modbus.toml").write_text("[valve]\nstroke_m = 0.1\n[device]\nport = 1\n")
    (tmp_path / "slave.toml").write_text('[bus]\nkind = "canopen"\n')
    code = (
        "import sys\nsys.modules['can'] = sys.modules['canopen'] = None\n"
        "from positioner.cli.main import main\nsys.exit(main(sys.argv[1:]))"
    )
    said = {
        ("run", "daemon.toml"): "pip install 'positioner[canopen]'",
        ("sim", "slave.toml"): "needs canopen and python-can: pip install 'positioner[canopen]'",
        ("run", "modbus.toml"): "127.0.0.1:1 unit 1: nobody accepts a connection",
    }
    for (command, name), line in said.items():
        words = [sys.executable, "-c", code, command, str(tmp_path / name)]
        ended = subprocess.run(words, capture_output=True, text=True, timeout=100, check=False)
        assert (ended.returncode, ended.stdout, ended.stderr.count("\n")) == (2, "", 1), ended.stderr
        assert line in ended.stderr

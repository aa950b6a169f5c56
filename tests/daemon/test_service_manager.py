"""What systemd is told, on a socket of the test's own and a clock that the test sets."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from positioner.cli.parts.children import port_in
from positioner.daemon.service_manager import ServiceManager
from tests.children import running
from tests.daemon_files import PATIENT, daemon_file, slave_file


class Systemd:
    """The other end."""

    def __init__(self, name: str, watchdog_s: float | None = 2.0) -> None:
        self.now_s = 100.0
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind("\0" + name[1:] if name.startswith("@") else name)
        self.socket.setblocking(False)
        said = {} if watchdog_s is None else {"WATCHDOG_USEC": f"{watchdog_s * 1e6:.0f}"}
        self.manager = ServiceManager({"NOTIFY_SOCKET": name, **said}, lambda: self.now_s)

    def told(self) -> list[str]:
        try:
            return self.socket.recv(4096).decode().splitlines()
        except BlockingIOError:
            return []


@pytest.fixture
def systemd(tmp_path: Path) -> Iterator[Systemd]:
    systemd = Systemd(str(tmp_path / "notify"))
    yield systemd
    systemd.socket.close()


def test_it_is_told_when_the_daemon_serves_and_ends(systemd: Systemd) -> None:
    systemd.manager.ready(0.05, "serving FV-101 on 127.0.0.1:5502")
    assert systemd.told() == ["READY=1", "STATUS=serving FV-101 on 127.0.0.1:5502"]
    systemd.manager.stopping("Terminated\nWATCHDOG=1")
    assert systemd.told() == ["STOPPING=1", "STATUS=Terminated WATCHDOG=1"]


def test_the_watchdog_is_fed_while_every_cycle_turns_and_no_longer(systemd: Systemd) -> None:
    systemd.manager.ready(0.05, "")
    systemd.told()
    turns, fed = [0, 0], []
    for step in range(60):
        systemd.now_s += 0.125
        turns[0] += 100
        turns[1] += 100 * (step < 30)
        systemd.manager.feed(turns)
        if systemd.told() == ["WATCHDOG=1"]:
            fed.append(step)
    assert len(fed) == 8, "every half second of two"
    assert max(fed) < 32, "one of two loops stands: not fed"


def test_a_slow_loop_has_a_longer_watchdog(systemd: Systemd) -> None:
    systemd.manager.ready(10.0, "")
    assert systemd.told()[-1] == "WATCHDOG_USEC=30000000"
    turns, fed = [0], 0
    for step in range(600):
        systemd.now_s += 0.1
        turns[0] += step % 100 == 0
        systemd.manager.feed(turns)
        fed += systemd.told() == ["WATCHDOG=1"]
    assert fed >= 5


def test_an_abstract_socket_will_do() -> None:
    systemd = Systemd(f"@positioner-test-{os.getpid()}")
    systemd.manager.ready(0.05, "serving")
    assert systemd.told()[0] == "READY=1"
    systemd.socket.close()


@pytest.mark.parametrize("watchdog", ["", "x", "-1", "0"])
def test_without_a_watchdog_nothing_is_fed(tmp_path: Path, watchdog: str) -> None:
    systemd = Systemd(str(tmp_path / "notify"), None)
    manager = ServiceManager(
        {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": watchdog}, lambda: systemd.now_s
    )
    manager.ready(10.0, "")
    assert systemd.told() == ["READY=1", "STATUS="]
    systemd.now_s += 1e6
    manager.feed([1])
    assert systemd.told() == []
    systemd.socket.close()


def test_a_watchdog_of_another_process_is_not_ours(tmp_path: Path) -> None:
    systemd = Systemd(str(tmp_path / "notify"), None)
    said = {"NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "1000000", "WATCHDOG_PID": "1"}
    manager = ServiceManager(said, lambda: systemd.now_s)
    systemd.now_s += 1e6
    manager.feed([1])
    assert systemd.told() == []
    systemd.socket.close()


@pytest.mark.real_time
def test_a_running_daemon_says_when_it_serves_feeds_the_watchdog_and_says_that_it_ends(tmp_path: Path) -> None:
    systemd = Systemd(str(tmp_path / "notify"))
    systemd.socket.settimeout(60.0)
    environment = {**os.environ, "NOTIFY_SOCKET": str(tmp_path / "notify"), "WATCHDOG_USEC": "1000000"}
    with running("sim", slave_file(tmp_path), "--listen-port", "0") as slave:
        words = [sys.executable, "-P", "-m", "positioner.cli", "run"]
        path = daemon_file(tmp_path, port_in(slave), device=PATIENT)
        with subprocess.Popen(
            [*words, path], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        ) as daemon:
            try:
                ready = systemd.told()
                fed = [systemd.told() for _ in range(3)]
                daemon.send_signal(signal.SIGTERM)
                while (last := systemd.told()) == ["WATCHDOG=1"]:
                    pass
            finally:
                daemon.terminate()
                daemon.wait(60)
    systemd.socket.close()
    assert ready[0] == "READY=1"
    assert ready[1].startswith("STATUS=serving FV-101 on 127.0.0.1:")
    assert ready[2:] == ["WATCHDOG_USEC=6000000"], "three replies that do not come within two seconds"
    assert fed == [["WATCHDOG=1"]] * 3
    assert last == ["STOPPING=1", "STATUS=Terminated"]


def test_nobody_who_listens_is_no_harm(tmp_path: Path) -> None:
    for said in ({}, {"NOTIFY_SOCKET": str(tmp_path / "gone")}, {"NOTIFY_SOCKET": "@" + "x" * 200}):
        ServiceManager(said).ready(0.05, "serving")

"""Drivers are found by the name of their bus: the package of `docs/driver-package.md`, as a site installs it."""

import os
import re
import socket
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from threading import Thread

import pytest

from config.bus_plugins import DEVICES, DRIVERS
from config.device import Device
from config.entry_points import find_offers
from config.errors import InputError
from drivers import driver_for

GUIDE = "".join((Path(__file__).parents[2] / "docs" / name).read_text() for name in ("driver-package.md", "drivers.md"))


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", GUIDE, re.DOTALL)


def install(folder: Path, entries: dict[str, dict[str, str]], name: str = "acme-positioner") -> None:
    """Leave what a package manager leaves of a package."""
    metadata = folder / f"{name.replace('-', '_')}-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [
        line for group, each in entries.items() for line in (f"[{group}]", *(f"{k} = {v}" for k, v in each.items()))
    ]
    (metadata / "entry_points.txt").write_text("\n".join(lines) + "\n")


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """Return a folder with the guide's package installed."""
    project, _ = blocks("toml")
    for name, text in zip(("acme_device.py", "acme_driver.py"), blocks("python"), strict=True):
        (tmp_path / name).write_text(text)
    install(tmp_path, tomllib.loads(project)["project"]["entry-points"])
    return tmp_path


@pytest.fixture
def converter() -> Iterator[int]:
    """Serve the guide's device; give its port."""

    def serve() -> None:
        while True:
            try:
                line, _ = listener.accept()
            except OSError:
                return
            with line:
                while asked := line.recv(100):
                    assert asked == b"?\n", "a watcher commands nothing"
                    line.sendall(b"0.04 30000 31000\n")

    with socket.create_server(("127.0.0.1", 0)) as listener:
        thread = Thread(target=serve)
        thread.start()
        yield listener.getsockname()[1]
        listener.shutdown(socket.SHUT_RDWR)
        thread.join()


def positioner(site: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(site)}
    command = [sys.executable, "-m", "positioner.cli", *words]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=100)


def daemon_file(site: Path, *changes: tuple[str, str]) -> str:
    _, text = blocks("toml")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (site / "daemon.toml").write_text(text)
    return str(site / "daemon.toml")


def test_the_guides_package_drives_its_device(site: Path, converter: int) -> None:
    done = positioner(site, "probe", daemon_file(site, ("4001", str(converter))), "--count", "1")
    assert done.returncode == 0, done.stderr
    assert "FV-7 holds 31000.0 Pa" in done.stdout
    assert "position 0.040000 m (0.4000 p.u.), pressure 30000.0 Pa" in done.stdout


def test_its_schema_is_held_to_like_any_other(site: Path) -> None:
    done = positioner(site, "run", daemon_file(site, ("port =", "prt =")))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "device.prt: unknown key; allowed here: bus, host, port, reply_timeout_s" in done.stderr


def test_a_bus_that_nobody_offers_is_named_with_those_there_are(site: Path) -> None:
    done = positioner(site, "run", daemon_file(site, ('"acme"', '"amce"')))
    assert done.returncode == 2
    assert "device.bus: allowed are 'acme', 'canopen', 'modbus', 'rtu', got 'amce'" in done.stderr.replace('"', "'")


@pytest.mark.parametrize(
    ("broken", "said"),
    [
        ("raise OSError('no licence')\n", "positioner.devices: acme_device:AcmeDevice cannot be loaded: no licence"),
        ("import not_there\n", "bus 'acme' needs not_there, which is not installed"),
        (
            "from config.device import Device\nclass AcmeDevice(Device):\n    def untouched(self): return self\n",
            "positioner.devices: acme_device:AcmeDevice cannot be loaded: AcmeDevice.untouched is called read_only now",
        ),
    ],
)
def test_a_broken_package_fails_where_it_is_used(site: Path, broken: str, said: str) -> None:
    (site / "acme_device.py").write_text(broken)
    done = positioner(site, "run", daemon_file(site))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f"package acme-positioner: {said}" in done.stderr


def test_a_broken_package_fails_nowhere_else(site: Path) -> None:
    (site / "acme_device.py").write_text("raise OSError('no licence')\n")
    modbus = positioner(site, "run", daemon_file(site, ('"acme"', '"modbus"'), ("4001", "1")))
    assert "127.0.0.1:1" in modbus.stderr, "another bus is read, and its device not found"


def test_what_is_no_schema_is_not_taken_for_one(site: Path) -> None:
    (site / "acme_device.py").write_text("AcmeDevice = dict\n")
    done = positioner(site, "run", daemon_file(site))
    assert done.returncode == 2
    assert "acme_device:AcmeDevice is no config.device.Device" in done.stderr


def test_two_packages_with_the_same_bus_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, {DRIVERS: {"modbus": "other_driver:OtherDriver"}}, "other-positioner")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match="bus 'modbus' is offered by package"):
        find_offers(DRIVERS, "bus")


def test_a_schema_without_a_driver_is_one_line() -> None:
    with pytest.raises(InputError, match=r"device\.bus: acme: no installed package has its driver; there are: canopen"):
        driver_for(Device(bus="acme"))


def test_every_shipped_bus_has_both() -> None:
    assert find_offers(DEVICES, "bus").keys() == find_offers(DRIVERS, "bus").keys() >= {"modbus", "rtu", "canopen"}


def test_the_guide_needs_nothing_but_the_library() -> None:
    imported = re.findall(r"^(?:import|from) (\w+)", "".join(blocks("python")), re.MULTILINE)
    assert set(imported) <= {"positioner", "acme_device"} | sys.stdlib_module_names

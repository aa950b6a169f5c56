"""The shipped profiles: valid, and the defaults they show are the defaults."""

import tomllib

from config.daemon_file import DaemonFile, load_daemon
from config.device import ModbusTcpDevice
from config.file_kinds import VALVE_SAID
from config.loading import SHIPPED
from config.slave_file import ModbusTcpBus, load_slave
from config.valve_file import load_valve, shipped_valve

PROFILES = SHIPPED / "profiles"


def test_the_daemon_profile_shows_the_defaults() -> None:
    shown = load_daemon(PROFILES / "daemon.toml")
    least = DaemonFile.model_validate({"valve": {"name": "FV-101", "stroke_m": 0.1016}})
    assert shown == least


def test_the_daemon_profile_shows_every_key() -> None:
    text = (PROFILES / "daemon.toml").read_text()
    for name, field in DaemonFile.model_fields.items():
        assert f"[{name}]" in text, name
        keys = getattr(field.annotation, "model_fields", {})
        assert all(f"{key} = " in text or f"[{name}.{key}]" in text for key in keys), (name, list(keys))


def test_commented_lines_are_valid_too() -> None:
    """What a person uncomments must work: only lines that are keys or tables are uncommented here."""
    lines = (PROFILES / "daemon.toml").read_text().splitlines()
    keys = [line[2:] if line.startswith(("# [", "# ")) and ("=" in line or "# [" in line) else line for line in lines]
    text = "\n".join(line for line in keys if not line.startswith("value ="))
    DaemonFile.model_validate(tomllib.loads(text))


def test_the_slave_profile_is_valid() -> None:
    assert load_slave(PROFILES / "slave.toml").valve == "seed"


def test_the_profiles_of_an_ordinary_valve_are_those_of_one_device() -> None:
    daemon, slave = load_daemon(PROFILES / "daemon_ordinary.toml"), load_slave(PROFILES / "slave_ordinary.toml")
    assert isinstance(daemon.device, ModbusTcpDevice)
    assert isinstance(slave.bus, ModbusTcpBus)
    assert daemon.device.map == slave.bus.map
    assert (daemon.device.port, daemon.pressure.maximum_pa) == (slave.bus.port, slave.supply.maximum_pa)
    assert daemon.valve.stroke_m == load_valve(shipped_valve(slave.valve)).valve.stroke_m
    assert slave.sensor.quantum_m == daemon.valve.stroke_m / 4096 == daemon.device.map.position_m.scale
    assert daemon.device.reply_timeout_s < daemon.cycle.period_s < daemon.safety.stale_after_s
    assert (daemon.control.law, daemon.law) == ("slides", None)


def test_help_names_every_shipped_valve() -> None:
    assert [each.stem for each in sorted((SHIPPED / "valves").glob("*.toml")) if each.stem not in VALVE_SAID] == []

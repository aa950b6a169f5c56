"""A daemon as a process keeps the baseline and the counts over a restart, and tells a record it cannot read."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs
from tests.children import running

pytestmark = pytest.mark.real_time

WITHIN_S = 60.0
DAEMON = """[valve]
name = 'FV-101'
stroke_m = 0.1016
[device]
port = {port}
[cycle]
period_s = 5e-3
[supervisory]
port = 0
[law]
b_over_c_pa_per_m = -814542.6
k_over_c_pa = -22068.2
[health]
folder = 'health'
"""


@pytest.fixture
def slave_port(tmp_path: Path) -> Iterator[int]:
    slave = tmp_path / "slave.toml"
    slave.write_text("[initial]\nposition_m = 0.03\npressure_pa = 24000.0\n")
    with running("sim", slave, "--listen-port", "0") as ready:
        yield port_in(ready)


@contextmanager
def daemon(folder: Path, port: int) -> Iterator[Dcs]:
    file = folder / "daemon.toml"
    file.write_text(DAEMON.format(port=port))
    with running("run", file) as ready, Dcs("127.0.0.1", port_in(ready)) as dcs:
        yield dcs


def until_it_is(dcs: Dcs, name: str, value: float) -> None:
    end_s = time.monotonic() + WITHIN_S
    while dcs.get(name) != value:
        assert time.monotonic() < end_s, f"{name} is {dcs.get(name)}"
        time.sleep(0.02)


def test_baseline_and_counts_outlive_the_daemon(tmp_path: Path, slave_port: int) -> None:
    record = tmp_path / "health" / "FV-101.health.json"
    with daemon(tmp_path, slave_port) as dcs:
        dcs.set("health_baseline", 1)
        until_it_is(dcs, "friction_ratio", 1.0)
    stored = json.loads(record.read_text())
    assert stored["baseline_pa"] == 22068.2
    record.write_text(json.dumps(stored | {"travel_m": 0.5 * 0.1016, "reversals": 7, "baseline_pa": 11034.1}))
    with daemon(tmp_path, slave_port) as dcs:
        assert [dcs.get(name) for name in ("travel", "reversals", "friction_ratio")] == [0.5, 7, 2.0]
    assert json.loads(record.read_text())["reversals"] == 7
    record.write_text("{")
    with daemon(tmp_path, slave_port) as dcs:
        assert dcs.get("reversals") == 0
    told = [line for line in (tmp_path / "daemon.log").read_text().splitlines() if "health record" in line]
    assert len(told) == 1
    assert "is not JSON" in json.loads(told[0])["reason"]
    assert record.with_name(record.name + ".unreadable").read_text() == "{"

"""Metrics: right, by Prometheus' own parser, and every one that alerts and dashboard name is there."""

import json
import math
import re
import shutil
import subprocess
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest
from prometheus_client.parser import text_string_to_metric_families

from config.codes import Fault
from config.registers import JITTER_BOUNDS_S
from config.travel import Travel
from fieldbus.modbus.request_counts import RequestCounts
from fieldbus.modbus.server import RegisterServer
from northbound.metrics.exporter import serve_metrics
from northbound.metrics.scraped_valve import ScrapedValve
from northbound.metrics.valve_metrics import friction_interval_pa
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.daemon.cycle_statistics import CycleStatistics
from positioner.daemon.supervisory_registers import SupervisoryRegisters
from tests.children import child, running
from tests.daemon.panel import Panel
from tests.daemon_files import PATIENT, daemon_file, slave_file

DEPLOY = Path(__file__).parents[2] / "deploy"
ALERTS = DEPLOY / "prometheus" / "alerts.yml"
Series = dict[tuple[str, frozenset[tuple[str, str]]], float]


class Site:
    """A virtual valve's registers on a port, and the exporter's text."""

    def __init__(self) -> None:
        self.panel = Panel()
        counts = RequestCounts()
        self.panel.registers = SupervisoryRegisters(self.panel.cycle, Travel(0.1016), 0.0, 200e3, requests=counts)
        self.server = RegisterServer(self.panel.registers, "127.0.0.1", 0, 1, counts=counts)
        self.server.start()
        self.valve = ScrapedValve("FV-101", ("127.0.0.1", self.server.port, 1))
        self.port = serve_metrics([self.valve], "127.0.0.1", 0)

    def text(self) -> str:
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}/metrics", timeout=60) as answer:
            return str(answer.read().decode())

    def close(self) -> None:
        self.valve.close()
        self.server.stop()


@pytest.fixture(scope="module")
def site() -> Iterator[Site]:
    site = Site()
    site.panel.run(3)
    yield site
    site.close()


def parsed(text: str) -> Series:
    found: Series = {}
    for family in text_string_to_metric_families(text):
        for sample in family.samples:
            key = sample.name, frozenset(sample.labels.items())
            assert key not in found, f"{key} stands twice"
            found[key] = sample.value
    return found


def value(series: Series, name: str, **labels: str) -> float:
    return series[name, frozenset({"valve": "FV-101", **labels}.items())]


def test_the_values_are_those_of_the_registers(site: Site) -> None:
    series = parsed(site.text())
    assert value(series, "positioner_up") == 1
    assert value(series, "positioner_position_ratio") == pytest.approx(site.panel.get("position"))
    assert value(series, "positioner_friction_pascals") == pytest.approx(22e3)
    assert value(series, "positioner_fault", fault="none") == 1
    assert sum(v for (name, _), v in series.items() if name == "positioner_fault") == 1
    assert value(series, "positioner_requests_total", peer="plain") > 1
    assert math.isnan(value(series, "positioner_friction_interval_pascals", bound="low")), "nothing is identified"


def test_the_histogram_is_of_how_far_periods_are_off() -> None:
    statistics = CycleStatistics(1e-3)
    for started_s in (0.0, 1e-3, 2.015e-3, 3.015e-3, 9.515e-3):
        statistics.enter(started_s, 1e-4, 0)
    within = {name: statistics.periods_within(index) for index, name in enumerate(JITTER_BOUNDS_S)}
    assert [within[name] for name in ("10us", "20us", "2ms", "5ms", "10ms", "any")] == [2, 3, 3, 3, 4, 4]
    assert statistics.jitter_sum_us == 5515
    lockstep = CycleStatistics()
    lockstep.enter(0.0, 1e-4, 0)
    lockstep.enter(1.0, 1e-4, 0)
    assert lockstep.periods_within(len(JITTER_BOUNDS_S) - 1) == 0, "a device in lockstep has no jitter"


def test_the_interval_of_the_friction_is_that_of_the_newest_valid_estimate() -> None:
    nothing = dict.fromkeys(("k_over_c_valid", "static_up_valid", "static_down_valid"), 0.0)
    assert all(map(math.isnan, friction_interval_pa(nothing)))
    static = {"static_up_valid": 1, "static_down_valid": 1, "static_up_e": 22e3, "static_down_e": 18e3}
    deviations = {"static_up_std": 30.0, "static_down_std": 40.0}
    assert friction_interval_pa(nothing | static | deviations) == pytest.approx((20e3 - 49, 20e3 + 49))


def test_no_position_is_passed_on_that_nobody_measures(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    read = ScrapedValve.read
    with monkeypatch.context() as patched:
        patched.setattr(
            ScrapedValve, "read", lambda self: {**(read(self) or {}), "quality": 2.0, "fault": Fault.NO_REPLY}
        )
        series = parsed(site.text())
    assert math.isnan(value(series, "positioner_position_ratio"))
    assert value(series, "positioner_fault", fault="no_reply") == 1


def test_a_daemon_that_is_away_is_up_0_and_nothing_else_and_is_found_again(capsys: pytest.CaptureFixture[str]) -> None:
    site = Site()
    port = site.server.port
    assert value(parsed(site.text()), "positioner_up") == 1
    site.server.stop()
    series = parsed(site.text())
    assert {name for (name, labels) in series if ("valve", "FV-101") in labels} == {"positioner_up"}
    assert value(series, "positioner_up") == 0
    site.server = RegisterServer(site.panel.registers, "127.0.0.1", port, 1)
    site.server.start()
    assert value(parsed(site.text()), "positioner_up") == 1
    site.close()
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    assert said[1] == "FV-101: answers"


def named_in(text: str) -> set[str]:
    return set(re.findall(r"\bpositioner_\w+", text))


@pytest.mark.parametrize("path", [ALERTS, DEPLOY / "grafana" / "valves.json"], ids=lambda path: path.name)
def test_what_alerts_and_dashboard_name_is_there(site: Site, path: Path) -> None:
    there = {name for name, _ in parsed(site.text())}
    named = named_in(path.read_text())
    assert len(named) > 8
    assert named <= there


def test_every_metric_says_what_it_is(site: Site) -> None:
    documented = dict(re.findall(r"^# HELP (\w+) (.+)$", site.text(), re.MULTILINE))
    assert {re.sub(r"_(bucket|count|sum)$", "", name) for name, _ in parsed(site.text())} <= set(documented)


def test_labels_in_alerts_and_dashboard_have_such_values(site: Site) -> None:
    series = parsed(site.text())
    values = {pair for _, labels in series for pair in labels}
    for path in (ALERTS, DEPLOY / "grafana" / "valves.json"):
        text = path.read_text().replace('\\"', '"')
        for label, said in re.findall(r'(fault|ne107|kind|bound|peer)(?:!=|=~|=)"([\w|]+)"', text):
            assert {(label, each) for each in said.split("|")} <= values, (path.name, label, said)


def test_the_dashboard_is_json_with_panels_that_do_not_overlap() -> None:
    board = json.loads((DEPLOY / "grafana" / "valves.json").read_text())
    places = [panel["gridPos"] for panel in board["panels"]]
    cells = [(x, y) for p in places for x in range(p["x"], p["x"] + p["w"]) for y in range(p["y"], p["y"] + p["h"])]
    assert len(cells) == len(set(cells))
    assert max(x for x, _ in cells) == 23


@pytest.mark.skipif(shutil.which("promtool") is None, reason="needs promtool, of Debian's package prometheus")
def test_promtool_finds_nothing_wrong(site: Site, tmp_path: Path) -> None:
    assert promtool("check", "metrics", text=site.text()) == ""
    assert "9 rules found" in promtool("check", "rules", "--lint-fatal", str(ALERTS))
    for name in ("alerts.yml", "scrape.yml"):
        shutil.copy(DEPLOY / "prometheus" / name, tmp_path)
    promtool("check", "config", str(tmp_path / "scrape.yml"))
    cases = tmp_path / "cases.yml"
    cases.write_text((Path(__file__).parent / "alerts_test.yml").read_text().replace("ALERTS", str(ALERTS)))
    assert "SUCCESS" in promtool("test", "rules", str(cases))


def promtool(*words: str, text: str = "") -> str:
    """Return what it says; it must find nothing wrong."""
    said = subprocess.run(["promtool", *words], input=text, capture_output=True, text=True, check=False)
    assert said.returncode == 0, said.stdout + said.stderr
    return said.stdout + said.stderr


def test_bad_input_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = daemon_file(tmp_path, 5020)
    assert main(["metrics", str(path), str(path)]) == 2
    assert "valve.name: 'FV-101' is also in another file" in capsys.readouterr().err
    assert main(["metrics", str(path), "--listen-port", "99999"]) == 2
    assert "--listen-port: must lie between 0" in capsys.readouterr().err
    assert main(["metrics", str(path), "--listen-host", "192.0.2.1", "--listen-port", "0"]) == 2
    assert "cannot listen there" in capsys.readouterr().err


@pytest.mark.real_time
def test_a_running_daemon_is_scraped_by_the_command(tmp_path: Path) -> None:
    with running("sim", slave_file(tmp_path), "--listen-port", "0") as slave:
        path = daemon_file(tmp_path, port_in(slave), "", PATIENT)
        with running("run", path) as ready:
            served = tmp_path / "served.toml"
            served.write_text(
                path.read_text().replace("[supervisory]\nport = 0", f"[supervisory]\nport = {port_in(ready)}")
            )
            with child("metrics", served, "--listen-port", "0") as (_, said):
                url = said.partition(" on ")[2]
                with urllib.request.urlopen(url, timeout=60) as answer:
                    series = parsed(answer.read().decode())
    assert value(series, "positioner_up") == 1
    assert value(series, "positioner_cycle_jitter_seconds_bucket", le="+Inf") > 0
    assert value(series, "positioner_cycle_jitter_seconds_count") > 0

"""Tests on the valve of a running daemon, in real time: what is measured, one at a time, and power that is lost."""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from config.codes import ExperimentState, Fault
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs
from positioner.history.kept_tests import folder_of
from positioner.tests_on_the_valve.kept_records import records
from tests.children import Child, child
from tests.tests_on_the_valve.virtual_valve import AREA_M2, MAXIMUM_PA, SLOPE, STROKE_M

pytestmark = [pytest.mark.long, pytest.mark.patient]

SLAVE = f"""valve = "ordinary"
[clock]
period_s = 0.005
[initial]
position_m = 0.02
pressure_pa = 60e3
[supply]
maximum_pa = {MAXIMUM_PA}
"""
SITE = f"""[valve]
name = "FV-1"
stroke_m = {STROKE_M}
[device]
port = DEVICE
reply_timeout_s = 0.4
communication_timeout_s = 3.0
[cycle]
period_s = 0.05
[pressure]
maximum_pa = {MAXIMUM_PA}
[safety]
stale_after_s = 2.0
[law]
b_over_c_pa_per_m = -{SLOPE}
k_over_c_pa = -{180.0 / AREA_M2}
offset_pa = 20e3
[supervisory]
port = SERVED
[recorder]
folder = "recordings"
[history]
folder = "history"
"""


class Site(NamedTuple):
    """A daemon in automatic, with consent."""

    config: Path
    daemon: Child
    port: int

    def dcs(self) -> Dcs:
        return Dcs("127.0.0.1", self.port, 1)


@contextmanager
def running(folder: Path, device: int, more: str = "") -> Iterator[Site]:
    config, text = folder / "site.toml", SITE.replace("DEVICE", str(device)) + more
    config.write_text(text.replace("SERVED", "0"))
    with child("run", config) as (daemon, serving):
        site = Site(config, daemon, port_in(serving))
        config.write_text(text.replace("SERVED", str(site.port)))
        yield site


def wait_until(site: Site, register: str, value: int) -> None:
    due_s = time.monotonic() + 120.0
    with site.dcs() as dcs:
        while dcs.get(register) != value:
            assert time.monotonic() < due_s
            time.sleep(0.1)


def test_steps_and_continuous_stroke_are_played_one_at_a_time_and_power_that_is_lost_is_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "slave.toml").write_text(SLAVE)
    with child("sim", tmp_path / "slave.toml", "--listen-port", "0") as (_, listening):
        with running(tmp_path, port_in(listening)) as site:
            words = [str(site.config)]
            assert main(["steps", *words]) == 1
            assert "the mode is not automatic" in capsys.readouterr().err
            with site.dcs() as dcs:
                dcs.set("mode", 2)
                assert main(["steps", *words]) == 1
                assert "the DCS has not consented" in capsys.readouterr().err
                dcs.set("experiment_consent", 1)
            assert main(["steps", *words, "--held-s", "0.6", "--keep", "as_found"]) == 0, capsys.readouterr()
            assert main(["cst", *words, "--rate", "0.01", "--keep", "as_found"]) == 0, capsys.readouterr()
            told = {each.outcome.test: each.outcome for each in records(folder_of(tmp_path / "history", "FV-1"))}
            breakaway = told["continuous stroke test"].figure("breakaway_pa")
            assert breakaway.value == pytest.approx(235.0 / AREA_M2, abs=1.5 * (breakaway.plus_minus or 0.0))
            assert told["step test"].figure("dead_band_pa").value == pytest.approx(415.0 / AREA_M2, rel=0.15)

            command = [sys.executable, "-m", "positioner.cli", "pst", *words, "--keep", "as_left"]
            with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as tester:
                wait_until(site, "experiment_state", ExperimentState.UNDER_WAY)
                assert main(["pst", *words]) == 1
                assert "an experiment is under way" in capsys.readouterr().err
                site.daemon.kill()
                assert tester.stderr is not None
                assert tester.stderr.read().count("\n") == 1
            assert tester.returncode == 1
        newest = records(folder_of(tmp_path / "history", "FV-1"))[-1]
        assert (newest.kind, newest.outcome.said) == ("", "broken off")
        with running(tmp_path, port_in(listening)) as site, site.dcs() as dcs:
            before = dcs.get_all("mode", "fault", "experiment_state", "command")
            assert (before["mode"], before["fault"], before["experiment_state"]) == (0, Fault.NONE, 0)
            time.sleep(1.0)
            assert dcs.get("command") == before["command"], "nothing moves it by itself"

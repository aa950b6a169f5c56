"""Experiments on a daemon that runs as a process: played, recorded, refused, vetoed, broken off by Ctrl-C."""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from config.codes import ExperimentState, State
from config.daemon_file import load_daemon
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.cli.parts.experiment_player import RunningValve, is_of, player_on
from positioner.dcs import Dcs
from positioner.tests_on_the_valve.program import Leap, ramped
from tests.children import running
from tests.daemon_files import daemon_file, slave_file
from tests.waiting import until
from workbench.discriminate.experiment_design import Course, DesignedExperiment, Leg

pytestmark = pytest.mark.real_time

COURSE = Course("by hand", 30e3, (Leg(45e3, 0.3, 0.3), Leg(25e3, 0.3, 0.3)))
RECORDER = "[recorder]\nfolder = 'recordings'\n"


@dataclass(frozen=True)
class Site:
    """A running daemon: its file, and where it serves."""

    config: Path
    port: int

    @property
    def arguments(self) -> argparse.Namespace:
        return argparse.Namespace(config=self.config, name=None, tls=None)

    def dcs(self) -> Dcs:
        return Dcs("127.0.0.1", self.port)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    with running("sim", slave_file(tmp_path), "--listen-port", "0") as slave:
        path = daemon_file(tmp_path, port_in(slave), RECORDER, device="reply_timeout_s = 2.0\n")
        with running("run", path) as ready:
            port = port_in(ready)
            # Where a client looks: the port that was taken.
            path.write_text(path.read_text().replace("port = 0", f"port = {port}"))
            yield Site(path, port)


def permitted(site: Site) -> None:
    with site.dcs() as dcs:
        dcs.set("mode", 2)
        dcs.set("experiment_consent", 1)


def words(site: Site) -> list[str]:
    return ["discriminate", str(site.config), "--rec", "none.csv", "--valve", "seed"]


def test_what_is_missing_is_said_before_anything_is_worked_out(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words(site)) == 1
    assert "the mode is not automatic" in capsys.readouterr().err
    with site.dcs() as dcs:
        dcs.set("mode", 2)
        until(lambda: dcs.get("mode") == 2, "automatic")
    assert main(words(site)) == 1
    assert "has not consented to experiments: positioner set experiment_consent 1" in capsys.readouterr().err
    with site.dcs() as dcs:
        dcs.set_all({"experiment_consent": 1, "experiment_veto": 1})
    assert main(words(site)) == 1
    assert "experiments are vetoed" in capsys.readouterr().err
    with site.dcs() as dcs:
        dcs.set("experiment_veto", 0)
    whole = site.config.read_text()
    site.config.write_text(whole + "[experiment]\ntravel_window = [0.7, 0.95]\n")
    assert main(words(site)) == 1
    assert "of its stroke, outside [experiment] travel_window = [0.7, 0.95]" in capsys.readouterr().err
    site.config.write_text(whole)
    site.config.write_text(site.config.read_text().replace(RECORDER, ""))
    assert main(words(site)) == 2
    assert "recorder: is needed" in capsys.readouterr().err


def test_an_experiment_is_played_recorded_and_found(site: Site) -> None:
    permitted(site)
    played = player_on(load_daemon(site.config), site.arguments)(DesignedExperiment(COURSE, 1.0))
    assert played.problem == ""
    assert played.recording is not None
    assert is_of(played.recording, COURSE.points())
    other = Course("another", 30e3, (Leg(25e3, 0.3, 0.3), Leg(45e3, 0.3, 0.3)))
    assert not is_of(played.recording, other.points())
    assert set(played.recording.columns["state"]) == {State.S3_IDENTIFY}
    assert np.ptp(played.recording.position_m) > 0.0
    with site.dcs() as dcs:
        assert dcs.get("command") == pytest.approx(24e3), "the pressure before has come back"
    assert_turns(RunningValve(load_daemon(site.config), site.arguments))


def assert_turns(valve: RunningValve) -> None:
    """Assert that a program turns at its travel, and that its recording is found although it is not the whole."""
    begun_m, start_pa = valve.stem_m(), valve.command_pa()
    program = ramped("up", start_pa, (Leap(start_pa, 0.2), Leap(start_pa + 60e3, 0.1)), 60e3, turn_m=5e-3, band_m=0.02)
    played = valve.play(program)
    assert (played.state, played.problem) == (ExperimentState.TURNED, "")
    assert played.recording is not None
    assert 5e-3 <= float(np.max(played.recording.position_m)) - begun_m < 0.02
    assert float(np.max(played.recording.command_pa)) < start_pa + 60e3
    assert valve.command_pa() == pytest.approx(start_pa)
    refused = valve.play(replace(program, points=((0.0, 1e6), (1.0, 1e6))))
    assert refused.state is ExperimentState.BEYOND_PRESSURE
    assert refused.recording is None, "what was played before is none of its rows"


def test_a_veto_from_elsewhere_stops_it(site: Site) -> None:
    with site.dcs() as dcs:
        dcs.set_all({"mode": 2, "experiment_consent": 1})
        until(lambda: dcs.get("mode") == 2, "automatic")
        dcs.set("experiment_veto", 1)
        assert dcs.play(COURSE.points(), 30.0) is ExperimentState.VETOED
        assert dcs.get("experiment_veto") == 1, "it is not ours to take back"


def test_ctrl_c_breaks_it_off_and_takes_its_veto_back(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    permitted(site)
    with site.dcs() as dcs:
        first = [True]

        def interrupted(wait_s: float) -> None:
            time.sleep(wait_s)
            if first and dcs.get("experiment_state") == ExperimentState.UNDER_WAY:
                first.clear()
                time.sleep(0.05)
                raise KeyboardInterrupt

        clock = SimpleNamespace(monotonic=time.monotonic, sleep=interrupted)
        monkeypatch.setattr("positioner.dcs.time", clock)
        with pytest.raises(KeyboardInterrupt):
            dcs.play(COURSE.points(), 30.0)
        assert dcs.get("experiment_state") == ExperimentState.VETOED
        assert dcs.get("experiment_veto") == 0
        assert dcs.get("command") == pytest.approx(24e3)

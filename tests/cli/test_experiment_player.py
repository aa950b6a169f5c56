"""What is said of an experiment that was not played to its end."""

import argparse
from contextlib import nullcontext
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from config.codes import ExperimentState, Fault
from config.daemon_file import DaemonFile
from config.recording import Recording
from positioner.cli.parts import experiment_player
from positioner.cli.parts.experiment_player import RunningValve, is_of, wait_until_landed, why_not
from positioner.dcs import Dcs


class Panel:
    """The registers of a daemon with a fault, or without."""

    def __init__(self, fault: Fault) -> None:
        self._fault = fault

    def get(self, name: str) -> float:
        assert name == "fault"
        return float(self._fault)


@pytest.mark.parametrize(
    ("state", "fault", "said"),
    [
        (ExperimentState.FAULT, Fault.STALLED, "fault: the daemon stood still"),
        (ExperimentState.FAULT, Fault.NONE, "fault (see there)"),
        (ExperimentState.VETOED, Fault.STALLED, "vetoed"),
    ],
    ids=["which fault", "acknowledged since", "no fault of the experiment's"],
)
def test_of_a_fault_it_is_said_which(state: ExperimentState, fault: Fault, said: str) -> None:
    assert why_not(state, cast(Dcs, Panel(fault))) == said


class Landing:
    """A daemon whose command goes on for forty cycles."""

    cycles = 0.0

    def get(self, name: str) -> float:
        self.cycles += name == "cycles"
        return self.cycles if name == "cycles" else min(self.cycles, 40.0)


def test_a_test_begins_once_the_law_has_held_its_command_for_ten_cycles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(experiment_player, "LANDING_POLL_S", 0.0)
    monkeypatch.setattr(experiment_player, "recordings_of", lambda *_: Path())
    valve = Landing()
    monkeypatch.setattr(experiment_player, "daemon_of", lambda _: nullcontext(valve))
    assert RunningValve(cast(DaemonFile, None), argparse.Namespace()).command_pa() == 40.0
    assert valve.cycles >= 50.0
    monkeypatch.setattr(experiment_player, "LANDS_WITHIN_S", 0.0)
    wait_until_landed(cast(Dcs, valve))
    assert valve.cycles < 60.0, "a law that never holds its command is not waited for without end"


FAST = ((0.0, 20e3), (1.0, 20e3), (3.0, 100e3), (4.0, 100e3), (6.0, 20e3), (7.0, 20e3))


@pytest.mark.parametrize(
    ("points", "same"),
    [
        (FAST, True),
        (((0.0, 20e3), (1.0, 20e3), (3.0, 80e3), (4.0, 80e3), (6.0, 20e3), (7.0, 20e3)), False),
        (((0.0, 20e3), (1.0, 20e3), (2.0, 100e3), (5.0, 100e3), (6.0, 20e3), (7.0, 20e3)), False),
    ],
    ids=["what was played", "not so far", "faster"],
)
@pytest.mark.parametrize("late_s", [0.0, 0.02, 0.4], ids=["never", "by little", "by eight cycles"])
def test_a_sequence_is_found_however_late_its_cycles_were(
    points: tuple[tuple[float, float], ...], same: bool, late_s: float
) -> None:
    """A command of 50 ms lags a ramp by 2 % of what that spans; every fifth cycle is late by so much besides."""
    time_s = np.cumsum(np.where(np.arange(200) % 5 == 0, 0.05 + late_s, 0.05))
    time_s = time_s[time_s < 7.9]  # and the last rows may be missing
    decided_s = np.concatenate([time_s[:1], time_s[:-1]]) - 0.5
    columns = {"time_s": time_s, "command_pa": np.interp(decided_s, *np.array(FAST).T), "position_m": 0.0 * time_s}
    assert is_of(Recording(columns), points) is same

"""What is said of an experiment that was not played to its end."""

from typing import cast

import numpy as np
import pytest

from config.codes import ExperimentState, Fault
from config.recording import Recording
from positioner.cli.parts.experiment_player import is_of, why_not
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
def test_a_ramp_of_a_slow_loop_is_found_though_cycles_were_late(
    points: tuple[tuple[float, float], ...], same: bool
) -> None:
    """A command that is held for 50 ms lags a ramp by 2 % of what that spans."""
    time_s = np.arange(0.0, 8.0, 0.05) + np.random.default_rng(0).uniform(0.0, 0.02, 160)
    held_s = np.repeat(np.arange(0.0, 8.0, 0.1), 2)[: len(time_s)] - 0.5
    time_s, held_s = time_s[:-10], held_s[:-10]  # and the last rows are missing
    columns = {"time_s": time_s, "command_pa": np.interp(held_s, *np.array(FAST).T), "position_m": 0.0 * time_s}
    assert is_of(Recording(columns), points) is same

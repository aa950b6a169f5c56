"""What is said of an experiment that was not played to its end."""

from typing import cast

import pytest

from config.codes import ExperimentState, Fault
from positioner.cli.parts.experiment_player import why_not
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

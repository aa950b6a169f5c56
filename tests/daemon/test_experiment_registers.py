"""An experiment over the registers: points in order, a start that counts them, the state; all or nothing."""

import pytest
from pymodbus.constants import ExcCodes

from config.codes import ExperimentState
from config.registers import BY_NAME, MOST_EXPERIMENT_POINTS
from fieldbus.modbus.function_codes import RegisterError
from tests.daemon.panel import Panel, refused

POINTS = ((0.0, 30e3), (0.05, 30e3), (0.2, 40e3))


def write_point(panel: Panel, number: int, time_s: float, pressure_pa: float) -> None:
    values = {"experiment_point": number, "experiment_time": time_s, "experiment_pressure": pressure_pa}
    words = [word for name, value in values.items() for word in BY_NAME[name].format.encode(value)]
    panel.registers.write(BY_NAME["experiment_point"].address, words, "test")


def loaded() -> Panel:
    panel = Panel()
    panel.set("mode", 2)
    panel.run()
    for number, point in enumerate(POINTS):
        write_point(panel, number, *point)
    return panel


def test_points_are_taken_in_order_and_played_when_they_are_counted() -> None:
    panel = loaded()
    assert panel.get("experiment_points") == len(POINTS)
    assert panel.get("experiment_pressure") == 40e3
    panel.set("experiment_consent", 1)
    panel.set("experiment_start", len(POINTS))
    panel.run(5)
    assert panel.get("experiment_state") == ExperimentState.UNDER_WAY
    panel.run(3000)
    assert panel.get("experiment_state") == ExperimentState.COMPLETE


def test_without_consent_nothing_moves() -> None:
    panel = loaded()
    before_pa = panel.get("command")
    panel.set("experiment_start", len(POINTS))
    panel.run(50)
    assert panel.get("experiment_state") == ExperimentState.NO_CONSENT
    assert panel.get("command") == before_pa


def test_a_veto_breaks_it_off() -> None:
    panel = loaded()
    panel.set("experiment_consent", 1)
    panel.set("experiment_start", len(POINTS))
    panel.run(5)
    panel.set("experiment_veto", 1)
    panel.run(1500)
    assert panel.get("experiment_state") == ExperimentState.VETOED


def test_a_start_that_miscounts_and_a_point_out_of_turn_are_refused() -> None:
    panel = loaded()
    assert refused(panel, "experiment_start", len(POINTS) - 1) is ExcCodes.ILLEGAL_VALUE
    assert refused(panel, "experiment_time", 1.0) is ExcCodes.ILLEGAL_VALUE
    assert refused(panel, "experiment_start", MOST_EXPERIMENT_POINTS + 1) is ExcCodes.ILLEGAL_VALUE
    before = panel.cycle.requests
    with pytest.raises(RegisterError):
        write_point(panel, len(POINTS) + 1, 1.0, 1.0)
    assert panel.cycle.requests == before
    write_point(panel, 0, 0.0, 20e3)
    assert panel.get("experiment_points") == 1, "point 0 begins anew"

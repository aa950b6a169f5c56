"""Where the stem is sent beyond a cut-off: onto its stop, from the reference on."""

import pytest

from config.codes import Fault
from tests.control.test_controller import STROKE_M, automatic


@pytest.mark.parametrize(
    ("stem", "alarms"), [(0.25, (Fault.TRAVEL_DEVIATION,)), (0.0, ())], ids=["open", "on its seat"]
)
def test_a_stem_that_stays_open_deviates_and_one_on_its_seat_does_not(stem: float, alarms: tuple[Fault, ...]) -> None:
    bench = automatic(control={"cutoff_low": 0.2}, supervision={"travel_deviation": {"threshold": 0.1, "delay_s": 0.0}})
    bench.position_m = stem * STROKE_M
    bench.ask(reference_m=0.12 * STROKE_M)
    for _ in range(3):
        decision = bench.step()
    assert decision.command_pa == 0.0
    assert decision.alarms == alarms

"""Lead against a lag: the pressure of a real path arrives early and goes no farther, also if its lag is known amiss."""

from math import exp

import pytest

from config.extended_valve import Inverse
from positioner.control.pressure_lead import PathMemory, after_step, long_held

H = 0.02
LIMITS_PA = (0.0, 4e5)


def led(inverse: Inverse, true_lag_s: float, steps: int, *, lead: bool = True) -> tuple[list[float], list[PathMemory]]:
    """Return the true pressures, Pa, and the memories after a change from 20 to 60 kPa at 0 s."""
    pressure_pa, memory = 2e4, long_held(2e4)
    memory = after_step(memory, 0.0, 2e4, inverse, LIMITS_PA, lead=lead)
    pressures, memories = [], []
    for number in range(1, steps + 1):
        pressure_pa += (1.0 - exp(-H / true_lag_s)) * (memory.command_pa - pressure_pa)
        memory = after_step(memory, number * H, 6e4, inverse, LIMITS_PA, lead=lead)
        pressures.append(pressure_pa)
        memories.append(memory)
    return pressures, memories


def test_the_pressure_arrives_within_a_period_but_for_what_is_left_to_itself() -> None:
    pressures, memories = led(Inverse(lag_s=0.1), 0.1, 3)
    assert pressures[0] == pytest.approx(2e4)
    assert pressures[1] == pytest.approx(6e4 - 0.02 * 4e4, rel=1e-6)
    assert memories[1].command_pa == memories[2].command_pa == 6e4


@pytest.mark.parametrize("amiss", [0.98, 1.02])
def test_a_lag_known_two_percent_amiss_takes_it_no_farther_than_that(amiss: float) -> None:
    pressures, _ = led(Inverse(lag_s=0.1), 0.1 * amiss, 30)
    assert max(pressures) < 6e4 + 0.005 * 4e4


def test_the_command_stays_within_its_limits_and_takes_the_time_that_they_leave() -> None:
    pressures, memories = led(Inverse(lag_s=1.0), 1.0, 12)
    assert max(each.command_pa for each in memories) == LIMITS_PA[1]
    assert max(pressures) <= 6e4
    assert pressures[-1] > 5.9e4


def test_without_leave_to_lead_the_command_is_what_is_wanted() -> None:
    _, memories = led(Inverse(lag_s=0.1), 0.1, 5, lead=False)
    assert {each.command_pa for each in memories} == {6e4}


@pytest.mark.parametrize(
    ("inverse", "arrives_s"),
    [
        (Inverse(lag_s=0.1), 0.1 * 2.303 + 2 * H),
        (Inverse(dead_time_s=0.3), 0.3 + H),
        (Inverse(filling_pa_per_s=1e5), 0.4 + H),
        (Inverse(filling_pa_per_s=1e5, dead_time_s=0.1), 0.5 + H),
    ],
)
def test_it_is_known_when_the_pressure_has_arrived(inverse: Inverse, arrives_s: float) -> None:
    _, memories = led(inverse, inverse.lag_s or 1e-6, 60)
    at_s = next(each.now_s for each in memories[1:] if each.has_arrived(each.now_s, inverse))
    assert at_s == pytest.approx(arrives_s, abs=1.5 * H)

"""A stem that moves all the time, without a slip: it moves, and so says every command."""

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import load_valve, shipped_valve
from positioner.estimation.recording_estimates import estimate
from workbench.compare.comparison import compare

T = np.arange(0.0, 60.0, 0.02)
VALVE = load_valve(shipped_valve("ordinary"))
MOTIONS = {
    "slowly up": (0.002 + 0.0005 * T, (1,)),
    "slowly down": (0.035 - 0.0005 * T, (-1,)),
    "up and down": (0.005 + 0.001 * np.minimum(T, 60.0 - T), (1, -1)),
    "a sine": (0.02 + 0.01 * np.sin(0.5 * T), (1, -1)),
    "two sines": (0.02 + 0.006 * np.sin(0.7 * T) + 0.004 * np.sin(1.9 * T), (1, -1)),
}


def recording(position_m: Column, noise_m: float = 5e-6) -> Recording:
    noise = noise_m * np.random.default_rng(3).standard_normal(T.size)
    return Recording({"time_s": T, "command_pa": 2e4 + 2e6 * position_m, "position_m": position_m + noise})


@pytest.mark.parametrize("noise_m", [5e-6, 0.0])
@pytest.mark.parametrize("kind", MOTIONS)
def test_it_is_said_to_move_both_ways_where_it_does(kind: str, noise_m: float) -> None:
    position_m, ways = MOTIONS[kind]
    said = "; ".join(compare(recording(position_m, noise_m), VALVE).sentences)
    assert "does not move" not in said
    assert ("only opens" in said, "only closes" in said) == (ways == (1,), ways == (-1,))


def test_a_still_stem_with_noise_is_said_not_to_move() -> None:
    still = Recording({**recording(np.full(T.size, 0.01)).columns, "command_pa": 4e4 + 1e3 * np.sin(T)})
    assert "the stem does not move" in compare(still, VALVE).sentences[0]


@pytest.mark.parametrize("kind", MOTIONS)
def test_what_cannot_be_estimated_of_it_is_not_for_want_of_motion(kind: str) -> None:
    found = estimate(recording(MOTIONS[kind][0]))
    reasons = {each.reason.text for each, _ in found.by_name.values() if not each.valid}
    assert not any("seen to move" in each for each in reasons), reasons


def test_a_signature_is_said_to_be_too_slow() -> None:
    """4 minutes from one end to the other and back, a sample each 0.2 s."""
    time_s = np.arange(0.0, 240.0, 0.2)
    slow_m = 0.0003 * np.minimum(time_s, 240.0 - time_s) + 5e-6 * np.random.default_rng(3).standard_normal(time_s.size)
    found = estimate(Recording({"time_s": time_s, "command_pa": 2e4 + 2e6 * slow_m, "position_m": slow_m}))
    assert "too slowly" in found.estimates.a.reason.text

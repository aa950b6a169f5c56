"""The position's noise, measured."""

import numpy as np
import pytest

from positioner.estimation.running_noise import PositionNoise
from tests.estimation.stem import NOISE, grid, run, swing


def measured(position: np.ndarray[tuple[int], np.dtype[np.float64]]) -> float:
    noise = PositionNoise()
    for block in np.array_split(position, 16):
        noise.add(block)
    return noise.std_m


def test_white_noise_is_measured_at_rest_and_through_a_jerk() -> None:
    rng = np.random.default_rng(0)
    assert measured(rng.normal(0, NOISE, 800)) == pytest.approx(NOISE, rel=0.15)
    moving = run(swing, grid(1e-3, -0.02, 0.78)).noisy(rng)
    assert measured(moving.position_m) == pytest.approx(NOISE, rel=0.15)


def test_a_smooth_motion_has_next_to_no_noise() -> None:
    assert measured(run(swing, grid(1e-3, -0.02, 0.78)).position_m) < 1e-3 * NOISE


def test_nothing_is_known_before_the_first_block() -> None:
    assert PositionNoise().std_m == 0.0

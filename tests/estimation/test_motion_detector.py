"""When motion begins and ends."""

import numpy as np
import pytest

from positioner.estimation.motion_detector import MotionDetector, motion_start


def test_begins_out_of_the_noise_and_ends_under_the_threshold() -> None:
    motion = MotionDetector(threshold_m_per_s=1.0)
    slopes = [0.0, 1.5, 2.1, 1.2, 0.9, 1.5, -2.1, -1.1, -0.9]
    assert [motion.update(slope, 0.2) for slope in slopes] == [0, 0, 1, 1, 0, 0, -1, -1, 0]


def test_a_reversal_passes_through_not_moving() -> None:
    motion = MotionDetector(1.0)
    assert [motion.update(slope, 0.0) for slope in (3.0, -3.0, -3.0)] == [1, 0, -1]


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("noise", [1e-9, 1e-3])
def test_beginning_is_found_in_the_positions(direction: int, noise: float) -> None:
    rng = np.random.default_rng(2)
    for _ in range(20):
        after = np.maximum(np.arange(50) - 30, 0)
        position = 0.5 + direction * 0.1 * after**2 + rng.normal(0, noise, 50)
        assert motion_start(position, direction, noise) == 30


def test_beginning_after_a_reversal_is_the_turning_point() -> None:
    position = -np.abs(np.arange(50) - 20.0)
    assert motion_start(position, -1, 1e-6) == 20

"""The quantum of a position sensor, as the landings find it; and a last bit that flickers is no motion."""

import numpy as np
import pytest

from positioner.estimation.landings.landing_detector import LandingDetector

STROKE_M = 0.04
QUANTUM_M = STROKE_M / 4096
PERIOD_S = 0.02


def seen(positions_m: np.ndarray) -> LandingDetector:
    """Return a detector that has seen positions, the command never changed."""
    detector = LandingDetector(STROKE_M)
    for index, position_m in enumerate(positions_m.tolist()):
        detector.update(index * PERIOD_S, position_m, 0.0, 0.0)
    return detector


def test_it_divides_every_step_though_no_step_was_as_short() -> None:
    """A slow loop sees a slide in one sample: the shortest step seen is a slide."""
    assert seen(QUANTUM_M * np.array((0, 90, 200, 335))).quantum_m == pytest.approx(5 * QUANTUM_M)
    assert seen(QUANTUM_M * np.array((0, 90, 200, 331))).quantum_m == pytest.approx(QUANTUM_M)


def test_a_sensor_that_resolves_more_has_none() -> None:
    noise_m = 1e-5 * np.random.default_rng(0).standard_normal(1000)
    assert seen(noise_m).quantum_m < 5e-6 * STROKE_M


def test_a_stem_rests_while_the_last_bit_flickers() -> None:
    """Also where it did not during the rest before, which then knew of no noise."""
    detector = seen(QUANTUM_M * np.array((0, 1, *(40 * [0]))))
    assert detector.rest is not None
    rng = np.random.default_rng(0)
    for index in range(120):
        detector.update(10.0 + index * PERIOD_S, QUANTUM_M * int(rng.random() < 0.1), 1.0, 0.0)
    assert detector.rest is not None

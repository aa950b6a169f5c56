"""The noise and the quantum of positions, on made-up samples."""

import numpy as np
import pytest

from config.noise import noise_by_median, noise_by_rms, quantum_m, white_noise_m

NOISE_M = 2e-5


def motion(count: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray(0.05 + 0.03 * np.sin(np.linspace(0.0, 6.0, count)))


def test_the_noise_is_found_under_a_smooth_motion() -> None:
    noise = np.random.default_rng(1).normal(0.0, NOISE_M, 6000)
    assert white_noise_m(motion(6000) + noise) == pytest.approx(NOISE_M, rel=0.1)
    assert white_noise_m(motion(6000)) < 1e-3 * NOISE_M


def test_a_jerk_in_a_block_hardly_counts_by_the_median_and_does_by_the_rms() -> None:
    differences = np.diff(np.random.default_rng(2).normal(0.0, NOISE_M, 67), 3)
    quiet = float(noise_by_median(differences)), float(noise_by_rms(differences))
    assert quiet == pytest.approx((NOISE_M, NOISE_M), rel=0.4)
    differences[30] = 100 * NOISE_M
    assert float(noise_by_median(differences)) < 1.2 * quiet[0]
    assert float(noise_by_rms(differences)) > 2 * quiet[1]


def test_every_block_has_a_noise_of_its_own() -> None:
    differences = np.diff(np.random.default_rng(3).normal(0.0, [[1e-6], [1e-4]], (2, 4000)), 3)
    for estimator in (noise_by_median, noise_by_rms):
        assert estimator(differences) == pytest.approx([1e-6, 1e-4], rel=0.1)


@pytest.mark.parametrize("count", [0, 1, 7])
def test_too_few_samples_have_no_noise(count: int) -> None:
    assert white_noise_m(motion(count)) == 0.0


@pytest.mark.parametrize(("rounded_to_m", "found_m"), [(2.5e-5, 2.5e-5), (1e-4, 1e-4), (0.0, 0.0)])
def test_positions_are_rounded_or_not(rounded_to_m: float, found_m: float) -> None:
    position_m = motion(3000)
    if rounded_to_m:
        position_m = np.round(position_m / rounded_to_m) * rounded_to_m
    position_m[5] = np.nan
    assert quantum_m(position_m) == pytest.approx(found_m, rel=1e-9)

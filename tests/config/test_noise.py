"""The noise and the quantum of positions, on made-up samples."""

from itertools import pairwise

import numpy as np
import pytest

from config.noise import noise_by_median, position_noise_m, quantum_m

NOISE_M = 2e-5


def motion(count: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.asarray(0.05 + 0.03 * np.sin(np.linspace(0.0, 6.0, count)))


Array = np.ndarray[tuple[int], np.dtype[np.float64]]


def noisy(position_m: Array, seed: int = 1) -> Array:
    return np.asarray(position_m + np.random.default_rng(seed).normal(0.0, NOISE_M, position_m.size))


def steps(every: int, count: int = 400) -> Array:
    """Rests of so many samples between jumps of some centimetres."""
    levels = np.random.default_rng(2).uniform(0.0, 0.1, count // every + 1)
    return np.asarray(np.repeat(levels, every)[:count])


def test_the_noise_is_found_under_a_smooth_motion() -> None:
    assert position_noise_m(noisy(motion(6000))) == pytest.approx(NOISE_M, rel=0.1)


@pytest.mark.parametrize("every", [3, 4, 5, 20, 100])
def test_the_noise_is_found_in_rests_however_short_and_never_in_the_jumps_between(every: int) -> None:
    assert position_noise_m(noisy(steps(every))) == pytest.approx(NOISE_M, rel=0.2)


@pytest.mark.parametrize("every", [1, 2])
def test_a_stem_that_rests_nowhere_tells_no_noise(every: int) -> None:
    moved = noisy(steps(every))
    assert position_noise_m(moved) is None
    assert position_noise_m(moved, 4e5 * steps(every)) is None
    assert position_noise_m(noisy(np.asarray(0.05 + 0.03 * np.sin(np.arange(400.0))))) is None


@pytest.mark.parametrize("period", [11.3, 20.0, 50.0, 100.0, 200.0])
def test_a_stem_that_swings_slowly_tells_no_noise_that_is_its_motion(period: float) -> None:
    assert position_noise_m(noisy(np.asarray(0.05 + 0.03 * np.sin(2 * np.pi * np.arange(600.0) / period)))) is None


@pytest.mark.parametrize("step_m", [1e-4, 1e-3])
def test_a_stem_that_wanders_from_sample_to_sample_tells_no_noise(step_m: float) -> None:
    walk = 0.05 + step_m * np.cumsum(np.random.default_rng(2).standard_normal(600))
    assert position_noise_m(noisy(np.asarray(walk))) is None


def test_steps_hardly_above_the_noise_are_not_taken_for_it() -> None:
    levels = 0.05 + 6 * NOISE_M * np.random.default_rng(2).standard_normal(120)
    found = position_noise_m(noisy(np.asarray(np.repeat(levels, 5))))
    assert found is None or found == pytest.approx(NOISE_M, rel=0.2)


def test_a_stem_at_rest_is_told_from_one_that_goes_elsewhere_at_every_sample_by_its_drive() -> None:
    still = noisy(np.full(600, 0.05))
    drive = np.random.default_rng(4).normal(0.0, 1e4, 600)
    assert position_noise_m(still, drive) == pytest.approx(NOISE_M, rel=0.1)
    assert position_noise_m(still, np.full(600, 1e4)) == pytest.approx(NOISE_M, rel=0.1)
    assert position_noise_m(still) is None
    follows = np.append(0.0, drive[:-1])
    assert position_noise_m(still + 1e-7 * follows, drive) is None


@pytest.mark.parametrize("white", [0.0, 0.2, 0.5, 2.0])
def test_rounding_is_part_of_the_noise(white: float) -> None:
    quantum = 1e-4
    seen = steps(25, 2000) + np.random.default_rng(5).normal(0.0, white * quantum, 2000)
    rounded = np.round(seen / quantum) * quantum
    assert position_noise_m(rounded) == pytest.approx(quantum * (white**2 + 1 / 12) ** 0.5, rel=0.1)


@pytest.mark.parametrize("quanta", [0.1, 0.2])
def test_a_rounding_that_lies_before_the_noise_is_no_noise(quanta: float) -> None:
    """Ramps of 60 and rests of 40 samples: a sensor rounds, and the wire adds white noise."""
    targets = np.random.default_rng(2).uniform(0.0, 0.1, 31)
    legs = [np.concatenate([np.linspace(begin, end, 60), np.full(40, end)]) for begin, end in pairwise(targets)]
    quantum = 3e-4
    rounded = np.round(np.concatenate(legs) / quantum) * quantum
    white = quanta * quantum * np.random.default_rng(5).standard_normal(rounded.size)
    assert position_noise_m(rounded + white) == pytest.approx(quanta * quantum, rel=0.1)


@pytest.mark.parametrize("count", [0, 1, 7, 15])
def test_too_few_samples_tell_no_noise(count: int) -> None:
    assert position_noise_m(noisy(np.full(count, 0.05)), np.ones(count)) is None


def test_without_noise_it_is_none_at_all() -> None:
    assert position_noise_m(steps(5)) == 0.0


def test_missing_samples_are_left_out() -> None:
    seen = noisy(steps(20, 800))
    seen[::37] = np.nan
    assert position_noise_m(seen) == pytest.approx(NOISE_M, rel=0.2)


def test_a_jerk_in_a_block_hardly_counts_by_the_median() -> None:
    differences = np.diff(np.random.default_rng(2).normal(0.0, NOISE_M, 67), 3)
    quiet = float(noise_by_median(differences))
    assert quiet == pytest.approx(NOISE_M, rel=0.4)
    differences[30] = 100 * NOISE_M
    assert float(noise_by_median(differences)) < 1.2 * quiet


def test_every_block_has_a_noise_of_its_own() -> None:
    differences = np.diff(np.random.default_rng(3).normal(0.0, [[1e-6], [1e-4]], (2, 4000)), 3)
    assert noise_by_median(differences) == pytest.approx([1e-6, 1e-4], rel=0.1)


@pytest.mark.parametrize(("rounded_to_m", "found_m"), [(2.5e-5, 2.5e-5), (1e-4, 1e-4), (0.0, 0.0)])
def test_positions_are_rounded_or_not(rounded_to_m: float, found_m: float) -> None:
    position_m = motion(3000)
    if rounded_to_m:
        position_m = np.round(position_m / rounded_to_m) * rounded_to_m
    position_m[5] = np.nan
    assert quantum_m(position_m) == pytest.approx(found_m, rel=1e-9)


def filtered(white: Array, samples: float) -> Array:
    """Return noise of the same variance that hangs together over so many samples, as behind a transmitter's filter."""
    kept = float(np.exp(-1.0 / samples))
    noise = [float(white[0])]
    for each in white[1:]:
        noise.append(kept * noise[-1] + (1.0 - kept**2) ** 0.5 * float(each))
    return np.asarray(noise)


@pytest.mark.parametrize("samples", [5.0, 20.0])
def test_noise_that_hangs_together_before_it_is_rounded_is_unknown_and_not_the_rounding_alone(samples: float) -> None:
    """Rounding makes it look white in windows too short to see the rest of it: a half was found, and called known."""
    quantum = 1.8 * NOISE_M
    noise = filtered(np.random.default_rng(5).normal(0.0, NOISE_M, 12000), samples)
    seen = steps(600, 12000) + noise
    assert position_noise_m(np.round(seen / quantum) * quantum, 1e5 * steps(600, 12000)) is None


def test_the_mains_beside_white_noise_make_it_unknown() -> None:
    """50 Hz at 2 kHz, of as much power as the noise: the white part alone is not what a reading is off by."""
    hum = 2.0**0.5 * NOISE_M * np.sin(2.0 * np.pi * 50.0 / 2000.0 * np.arange(12000.0))
    assert position_noise_m(noisy(np.asarray(steps(1000, 12000) + hum)), 1e5 * steps(1000, 12000)) is None


@pytest.mark.parametrize("samples", [20.0, 100.0, 300.0])
def test_a_stem_that_creeps_on_behind_a_lag_shows_its_noise_all_the_same(samples: float) -> None:
    drive = steps(600, 12000)
    kept = 1.0 - np.exp(-1.0 / samples)
    stem = [float(drive[0])]
    for each in drive[1:]:
        stem.append(stem[-1] + kept * (float(each) - stem[-1]))
    assert position_noise_m(noisy(np.asarray(stem)), 1e5 * drive) == pytest.approx(NOISE_M, rel=0.1)

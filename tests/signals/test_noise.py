"""The noise and the quantum of positions, on made-up samples."""

from itertools import pairwise

import numpy as np
import pytest

from signals.noise import frozen, held_back_m, noise_by_median, position_noise_m, quantum_m

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


@pytest.mark.parametrize("white", [0.05, 0.2, 0.5, 2.0])
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
    assert position_noise_m(slow_to_settle(steps(50, 2000))) == 0.0


def test_rests_without_noise_or_any_small_change_may_have_been_held_back_and_the_noise_is_unknown() -> None:
    assert position_noise_m(steps(5)) is None
    assert position_noise_m(exceptions(noisy(steps(12, 2000)), 5.0 * NOISE_M)) is None


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


def exceptions(position_m: Array, dead_band_m: float) -> Array:
    """What a historian that keeps no smaller changes shows at every sample: its last value."""
    kept = position_m.copy()
    for i in range(1, kept.size):
        kept[i] = position_m[i] if abs(position_m[i] - kept[i - 1]) > dead_band_m else kept[i - 1]
    return kept


@pytest.mark.parametrize("every", [5, 12, 50])
def test_what_a_historian_held_back_is_no_rounding_and_the_noise_is_unknown(every: int) -> None:
    quantum = 1.5 * NOISE_M
    rounded = np.round(noisy(steps(every, 2000)) / quantum) * quantum
    assert position_noise_m(rounded) == pytest.approx(np.hypot(NOISE_M, quantum / 12**0.5), rel=0.2)
    held = exceptions(rounded, 10.0 * NOISE_M)
    assert held_back_m(held, quantum) > 10.0 * NOISE_M
    assert position_noise_m(held) is None


def slow_to_settle(position_m: Array) -> Array:
    """What comes to rest so slowly that its last changes are as small as one likes."""
    stem = [float(position_m[0])]
    for each in position_m[1:]:
        left_m = 0.5 * (float(each) - stem[-1])
        stem.append(stem[-1] + left_m if abs(left_m) > 1e-8 else float(each))
    return np.asarray(stem)


def through_a_door(position_m: Array, width_m: float) -> Array:
    """What a historian shows that keeps a sample where no line from the one kept before passes all since."""
    kept = [0]
    up, down = np.inf, -np.inf
    for i in range(1, position_m.size):
        since = i - kept[-1]
        up = min(up, (position_m[i] + width_m - position_m[kept[-1]]) / since)
        down = max(down, (position_m[i] - width_m - position_m[kept[-1]]) / since)
        if down > up:
            kept.append(i - 1 if kept[-1] < i - 1 else i)
            since = max(i - kept[-1], 1)
            up = (position_m[i] + width_m - position_m[kept[-1]]) / since if kept[-1] < i else np.inf
            down = (position_m[i] - width_m - position_m[kept[-1]]) / since if kept[-1] < i else -np.inf
    return np.asarray(np.interp(np.arange(position_m.size), kept, position_m[kept]))


@pytest.mark.parametrize("quantum", [0.0, NOISE_M / 500.0, NOISE_M / 10.0])
@pytest.mark.parametrize("width", [2.0, 4.0, 8.0])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_straight_lines_that_a_historian_drew_are_no_sensor_without_noise(
    quantum: float, width: float, seed: int
) -> None:
    shown = through_a_door(noisy(steps(15, 2000), seed), width * NOISE_M)
    shown = np.round(shown / quantum) * quantum if quantum else shown
    found = position_noise_m(shown, 4e5 * steps(15, 2000))
    assert found is None or found == pytest.approx(NOISE_M, rel=0.5)


def test_a_noise_greater_than_what_was_held_back_is_found_all_the_same() -> None:
    quantum = NOISE_M / 8.0
    rounded = np.round(noisy(steps(50, 2000)) / quantum) * quantum
    kept = exceptions(rounded, NOISE_M / 2.0)
    shown = kept[np.append(True, np.diff(kept) != 0.0)]
    assert held_back_m(shown, quantum) > 0.0
    assert position_noise_m(shown) == pytest.approx(NOISE_M, rel=0.2)


@pytest.mark.parametrize("quantum", [0.0, NOISE_M / 4.0, NOISE_M])
def test_a_reading_that_is_repeated_is_no_rest_without_noise(quantum: float) -> None:
    def rounded(position_m: Array) -> Array:
        return np.asarray(np.round(position_m / quantum) * quantum) if quantum else position_m

    sound = rounded(noisy(steps(50, 2000)))
    assert not frozen(sound, quantum).any()
    stuck = sound.copy()
    for first in range(255, 2000, 300):
        stuck[first : first + 40] = stuck[first]
    assert frozen(stuck, quantum).sum() == pytest.approx(6 * 39, abs=3)
    assert position_noise_m(stuck) == pytest.approx(np.hypot(NOISE_M, quantum / 12**0.5), rel=0.1)


@pytest.mark.parametrize("quantum", [0.0, 5.0 * NOISE_M])
def test_a_stem_that_rests_within_a_quantum_or_without_noise_is_not_frozen(quantum: float) -> None:
    resting = motion(2000)
    resting[300:600] = resting[300]
    shown = np.round(noisy(resting) / quantum) * quantum if quantum else resting
    assert not frozen(shown, quantum).any()


def test_a_transmitter_at_the_end_of_its_range_is_not_frozen() -> None:
    limited = np.maximum(noisy(motion(2000)), 0.03)
    assert np.count_nonzero(limited == 0.03) > 100
    assert not frozen(limited, 0.0).any()


def test_few_moves_that_go_with_the_drive_are_no_noise() -> None:
    rng = np.random.default_rng(3)
    drive_pa = 4e5 * rng.uniform(0.0, 0.1, 40)
    moved = drive_pa / 4e5 + 0.025 * rng.standard_normal(40)
    assert position_noise_m(moved, drive_pa) is None
    assert position_noise_m(moved, np.full(40, 2e4)) == pytest.approx(0.038, rel=0.2)

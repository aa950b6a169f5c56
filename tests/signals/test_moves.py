"""Rests and moves, read off positions alone: slips that are drawn, slow slides, noise, and what creeps."""

import numpy as np
import pytest

from signals.moves import moves, moving

NOISE_M = 5e-5


def slips(generator: np.random.Generator, count: int = 4000) -> tuple[np.ndarray, list[int]]:
    """Return positions of a stem that slips now and then, each time within three samples, and when it leaves."""
    at = np.sort(generator.choice(np.arange(100, count - 100, 40), 12, replace=False))
    x_m = np.full(count, 0.03)
    for row in at:
        x_m[row + 1 :] += generator.choice([-1.0, 1.0]) * generator.uniform(20.0, 400.0) * NOISE_M
    x_m = np.convolve(np.pad(x_m, 1, mode="edge"), np.full(3, 1.0 / 3.0), mode="valid")
    return x_m + NOISE_M * generator.standard_normal(count), at.tolist()


@pytest.mark.parametrize("seed", range(8))
def test_each_slip_is_a_move_that_begins_where_the_stem_leaves(seed: int) -> None:
    x_m, at = slips(np.random.default_rng(seed))
    found = moves(x_m, NOISE_M)
    assert len(found) == len(at)
    for move, left in zip(found, at, strict=True):
        assert abs(move.before - left) <= 2
        assert left < move.after <= left + 6


def test_noise_alone_is_one_rest() -> None:
    generator = np.random.default_rng(5)
    seen = [int(moving(NOISE_M * generator.standard_normal(12_000), NOISE_M).sum()) for _ in range(20)]
    assert sum(each > 0 for each in seen) <= 6, "a window here and there; no move comes of it"
    assert not any(moves(NOISE_M * generator.standard_normal(12_000), NOISE_M) for _ in range(20))


@pytest.mark.parametrize("noises_a_sample", [0.05, 0.3, 1.0, 5.0])
def test_a_slow_slide_is_one_move_however_the_noise_hides_it(noises_a_sample: float) -> None:
    generator = np.random.default_rng(1)
    count = round(120.0 / noises_a_sample)
    x_m = np.concatenate([np.zeros(300), np.linspace(0.0, 120.0, count), np.full(300, 120.0)]) * NOISE_M
    (move,) = moves(x_m + NOISE_M * generator.standard_normal(x_m.size), NOISE_M)
    unseen = 8.0 / noises_a_sample
    assert abs(move.before - 300) <= 3 + unseen
    assert abs(move.after - 300 - count) <= 3 + unseen


def test_a_stem_that_sticks_on_its_way_rests_there() -> None:
    way = np.concatenate([np.zeros(200), np.linspace(0.0, 80.0, 40), np.full(60, 80.0), np.linspace(80.0, 160.0, 40)])
    x_m = np.concatenate([way, np.full(200, 160.0)]) * NOISE_M
    found = moves(x_m + NOISE_M * np.random.default_rng(2).standard_normal(x_m.size), NOISE_M)
    assert len(found) == 2


def test_the_end_of_a_slide_behind_a_lag_is_no_move_of_its_own() -> None:
    t = np.arange(1200)
    x_m = np.where(t < 200, 0.0, 400.0 * (1.0 - np.exp(-(t - 200.0) / 60.0))) * NOISE_M
    for seed in range(5):
        assert len(moves(x_m + NOISE_M * np.random.default_rng(seed).standard_normal(t.size), NOISE_M)) == 1


def test_a_record_may_begin_and_end_in_motion() -> None:
    x_m = np.concatenate([np.linspace(0.0, 300.0, 60), np.full(100, 300.0), np.linspace(300.0, 0.0, 60)]) * NOISE_M
    first, last = moves(x_m + NOISE_M * np.random.default_rng(3).standard_normal(x_m.size), NOISE_M)
    assert first.before <= 1
    assert last.after >= x_m.size - 2


def test_a_sample_without_a_number_moves_nothing() -> None:
    x_m = NOISE_M * np.random.default_rng(4).standard_normal(500)
    x_m[[0, 100, 101, 102, 499]] = np.nan
    assert not moves(x_m, NOISE_M)


def test_noise_in_a_rest_is_not_the_end_of_the_slide_before_it() -> None:
    """Of windows beyond 5 deviations one record in twenty has one: a bump of 1.5 noises over 32 samples is such."""
    x_m = np.concatenate([np.zeros(200), np.linspace(0.0, 900.0, 300), np.full(900, 900.0)]) * NOISE_M
    x_m += NOISE_M * np.random.default_rng(3).standard_normal(x_m.size)
    x_m[900:] += 1.5 * NOISE_M
    assert moving(x_m, NOISE_M)[880:920].any(), "the bump is seen"
    (move,) = moves(x_m, NOISE_M)
    assert abs(move.after - 500) <= 3

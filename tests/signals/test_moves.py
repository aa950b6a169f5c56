"""Rests and moves, read off positions alone: slips that are drawn, slow slides, noise, and what creeps."""

import numpy as np
import pytest

from signals.moves import directions, legs, moves, moving, rests_first, slips

NOISE_M = 5e-5


def slipping(generator: np.random.Generator, count: int = 4000) -> tuple[np.ndarray, list[int]]:
    """Return positions of a stem that slips now and then, each time within three samples, and when it leaves."""
    at = np.sort(generator.choice(np.arange(100, count - 100, 40), 12, replace=False))
    x_m = np.full(count, 0.03)
    for row in at:
        x_m[row + 1 :] += generator.choice([-1.0, 1.0]) * generator.uniform(20.0, 400.0) * NOISE_M
    x_m = np.convolve(np.pad(x_m, 1, mode="edge"), np.full(3, 1.0 / 3.0), mode="valid")
    return x_m + NOISE_M * generator.standard_normal(count), at.tolist()


@pytest.mark.parametrize("seed", range(8))
def test_each_slip_is_a_move_that_begins_where_the_stem_leaves(seed: int) -> None:
    x_m, at = slipping(np.random.default_rng(seed))
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


def test_a_stem_that_creeps_in_small_slips_after_a_large_step_makes_each_of_them() -> None:
    x_m = (1400.0 * (np.arange(260) >= 60) + 9.0 * sum((np.arange(260) >= row) for row in range(80, 200, 20))) * NOISE_M
    for seed in range(5):
        found = moves(x_m + NOISE_M * np.random.default_rng(seed).standard_normal(x_m.size), NOISE_M)
        assert [each.after for each in found] == [60, *range(80, 200, 20)]


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


def test_a_slip_goes_one_way_and_what_turns_without_a_rest_is_two() -> None:
    there = np.concatenate([np.zeros(100), np.linspace(0.0, 400.0, 50), np.linspace(400.0, 0.0, 50), np.zeros(100)])
    x_m = (there + np.random.default_rng(6).standard_normal(there.size)) * NOISE_M
    assert len(moves(x_m, NOISE_M)) == 1, "it comes back to where it was, and has moved"
    up, down = slips(x_m, NOISE_M)
    assert (up.direction, down.direction) == (1, -1)
    assert abs(up.last - 149) <= 1
    assert up.travel_m == pytest.approx(down.travel_m, abs=5.0 * NOISE_M)
    way = directions(x_m, NOISE_M)
    assert not way[:98].any()
    assert (way[103:148] == 1).all()
    assert (way[152:197] == -1).all()
    assert not way[203:].any()


def test_a_leg_begins_where_the_stem_sets_out_and_not_in_the_dwell_before() -> None:
    x = np.concatenate([np.linspace(0.0, 1.0, 50), np.ones(30), np.linspace(1.0, 0.0, 50)])
    assert [(begin, end, way) for begin, end, way in legs(x, 0.1)] == [(0, 49, 1), (80, 129, -1)]
    assert legs(0.05 * x, 0.1) == []


def test_a_record_first_rests_where_its_first_motion_ends_unless_its_command_began_that() -> None:
    x_m = np.concatenate([np.zeros(30), np.linspace(0.0, 300.0, 60), np.full(100, 300.0)]) * NOISE_M
    x_m += NOISE_M * np.random.default_rng(7).standard_normal(x_m.size)
    assert rests_first(x_m, NOISE_M) == 0
    assert rests_first(x_m, NOISE_M, held=30) == 0, "it moves as its command changes"
    assert abs((rests_first(x_m, NOISE_M, held=60) or 0) - 90) <= 3, "it moved before"
    curved_m = np.concatenate([np.cumsum(np.arange(60.0)[::-1]), np.full(100, 1770.0)]) * NOISE_M
    assert rests_first(curved_m, NOISE_M) is not None
    assert rests_first(np.cumsum(10.0 * np.arange(60.0) ** 2) * NOISE_M, NOISE_M) is None, "it never rests"

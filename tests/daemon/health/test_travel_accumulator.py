"""The travel accumulator: counts what the stem goes, and nothing of what the sensor adds."""

import math
import time

import numpy as np
import pytest

from positioner.daemon.health.travel_accumulator import TravelAccumulator

STROKE_M = 0.1
BAND_M = 5e-4


def fed(positions_m: np.ndarray) -> TravelAccumulator:
    travel = TravelAccumulator(STROKE_M, BAND_M)
    for position_m in positions_m.tolist():
        travel.enter(position_m)
    return travel


@pytest.mark.parametrize("std_m", [0.0, 1e-6, 1e-4, 3e-4])
def test_noise_at_rest_counts_nothing(std_m: float) -> None:
    """0.3 % of the stroke is six times the dead band from end to end."""
    noise_m = np.random.default_rng(1).normal(0.0, std_m, 300_000)
    travel = fed(0.05 + noise_m)
    assert (travel.travel_m, travel.reversals) == (0.0, 0)


def test_a_rounding_transmitter_that_chatters_counts_nothing() -> None:
    noise_m = np.random.default_rng(2).normal(0.0, 1e-5, 100_000)
    quantum_m = 2e-5
    assert fed(np.round((0.05 + noise_m) / quantum_m) * quantum_m).travel_m == 0.0


@pytest.mark.parametrize("std_m", [0.0, 1e-5, 1e-4])
def test_travel_and_reversals_of_slow_strokes_under_noise(std_m: float) -> None:
    """Ten times up and down 40 mm, resting at each end: 800 mm and 19 reversals."""
    up = np.linspace(0.02, 0.06, 2000)
    rest = np.full(500, 1.0)
    once = np.concatenate([up, 0.06 * rest, up[::-1], 0.02 * rest])
    positions_m = np.concatenate([0.02 * np.ones(3000), np.tile(once, 10)])
    travel = fed(positions_m + np.random.default_rng(3).normal(0.0, std_m, len(positions_m)))
    assert travel.reversals == 19
    # What lies between the last count and the end is lost on the way there and on the way back, a band each at most.
    band_m = max(BAND_M, 12 * std_m)
    assert 0.8 - 20 * 2 * band_m <= travel.travel_m <= 0.8 + 20 * 6 * std_m + 1e-9


def test_small_moves_add_up_only_beyond_the_dead_band() -> None:
    settled = np.full(2000, 0.05)
    crept = fed(np.concatenate([settled, np.linspace(0.05, 0.05 + 0.9 * BAND_M, 5000)]))
    assert crept.travel_m == 0.0
    gone = fed(np.concatenate([settled, np.linspace(0.05, 0.05 + 10.5 * BAND_M, 5000)]))
    assert gone.travel_m == pytest.approx(10 * BAND_M, rel=0.02)


def test_quick_steps_count_whole_although_the_stem_jerks() -> None:
    levels = np.tile([0.03, 0.07], 50)
    travel = fed(np.concatenate([np.full(2000, 0.03), np.repeat(levels[1:], 300)]))
    assert travel.travel_m == pytest.approx(99 * 0.04)
    assert travel.reversals == 98


def test_the_band_follows_the_noise_and_stays_below_a_twentieth_of_the_stroke() -> None:
    rng = np.random.default_rng(4)
    assert fed(rng.normal(0.05, 2e-4, 20_000)).band_m == pytest.approx(12 * 2e-4, rel=0.2)
    assert fed(rng.normal(0.05, 1e-2, 20_000)).band_m == pytest.approx(0.05 * STROKE_M)
    assert fed(rng.normal(0.05, 1e-6, 20_000)).band_m == BAND_M


def test_a_sample_costs_next_to_nothing() -> None:
    """Against 20 square roots of the same interpreter, so that a slow machine does not fail it."""
    positions_m = np.random.default_rng(5).normal(0.05, 1e-4, 50_000).tolist()
    travel = TravelAccumulator(STROKE_M, BAND_M)

    def seconds(work: object) -> float:
        best = math.inf
        for _ in range(5):
            started = time.perf_counter()
            work()  # type: ignore[operator]
            best = min(best, time.perf_counter() - started)
        return best

    def enter() -> None:
        for position_m in positions_m:
            travel.enter(position_m)

    def yardstick() -> None:
        for position_m in positions_m:
            for _ in range(20):
                math.sqrt(position_m)

    assert seconds(enter) < seconds(yardstick)

"""When a stem is called at rest, and where: on motions made by hand."""

import numpy as np
import pytest

from positioner.estimation.landings.stem_at_rest import RestWindow

STROKE_M = 0.1
PERIOD_S = 1e-3


def first_rest(position_m: np.ndarray, pressure_pa: np.ndarray | None = None, quantum_m: float = 0.0) -> int | None:
    """Return the sample with which the stem is called at rest for good."""
    window = RestWindow(STROKE_M)
    window.quantum_m = quantum_m
    window.restart(0.0)
    at = None
    for index, position in enumerate(position_m):
        pressure = np.nan if pressure_pa is None else pressure_pa[index]
        window.add(index * PERIOD_S, position, pressure)
        if window.rest is None:
            at = None
        elif at is None:
            at = index
    return at


def test_a_stem_that_does_not_move_rests() -> None:
    assert first_rest(np.full(100, 0.05)) == pytest.approx(7, abs=2)


@pytest.mark.parametrize("pressure_pa", [32011.08902975449, 1e5 / 3, 3e4 + 1e-7, 0.0])
def test_a_pressure_that_does_not_change_rests_whatever_the_last_bit_of_its_means(pressure_pa: float) -> None:
    count = 5000
    rounded_pa = pressure_pa * (1.0 + 1e-12 * (np.arange(count) > count // 2))
    for each in (np.full(count, pressure_pa), rounded_pa):
        assert first_rest(np.full(count, 0.0609538902568913), each) == pytest.approx(7, abs=2)


@pytest.mark.parametrize("time_constant_s", [0.005, 0.05, 0.3])
def test_a_creep_is_waited_for(time_constant_s: float) -> None:
    time_s = np.arange(8000) * PERIOD_S
    position_m = 0.05 - 0.005 * np.exp(-time_s / time_constant_s)
    at = first_rest(position_m)
    assert at is not None
    assert 0.05 - position_m[at] < 1e-4 * STROKE_M
    assert at * PERIOD_S < 13 * time_constant_s + 0.02


def test_noise_is_no_motion_and_the_position_is_a_mean() -> None:
    noise = np.random.default_rng(1).normal(0.0, 1e-4, 2000)
    window = RestWindow(STROKE_M)
    window.restart(0.0)
    for index, off_m in enumerate(noise):
        window.add(index * PERIOD_S, 0.05 + off_m, np.nan)
    assert window.rest is not None
    assert abs(window.rest.position_m - 0.05) < 4 * window.rest.std_m
    assert window.rest.std_m < 1e-5
    assert window.rest.noise_m == pytest.approx(1e-4, rel=0.2)


def test_a_creep_hidden_by_noise_is_waited_for_longer() -> None:
    time_s = np.arange(3000) * PERIOD_S
    creep_m = 0.05 - 0.008 * np.exp(-time_s / 0.05)
    noisy_m = creep_m + np.random.default_rng(2).normal(0.0, 1e-4, time_s.size)
    at = first_rest(noisy_m)
    assert at is not None
    assert (0.05 - creep_m)[at // 2] < 2e-5


def test_a_position_that_flickers_by_its_quantum_rests() -> None:
    quantum_m = STROKE_M / 1024
    flickering = 0.05 + quantum_m * (np.random.default_rng(3).random(400) < 0.3)
    assert first_rest(flickering, quantum_m=quantum_m) is not None


def test_nothing_rests_under_a_measured_pressure_that_moves() -> None:
    ramp = np.linspace(50e3, 60e3, 400)
    assert first_rest(np.full(400, 0.05), ramp) is None
    assert first_rest(np.full(400, 0.05), np.full(400, 50e3)) is not None


def test_a_long_rest_is_kept_in_a_bounded_memory() -> None:
    assert first_rest(np.full(20_000, 0.05)) is not None


def short_of(path_m: np.ndarray) -> float:
    """Return how far short of its balance a stem may have stuck, m, that went so from 0.05 m on and rests."""
    window = RestWindow(STROKE_M)
    window.restart(0.0)
    for index, position_m in enumerate(np.append(0.05, 0.05 + path_m)):
        window.add(index * PERIOD_S, position_m, np.nan)
    assert window.rest is not None
    return window.rest.short_m


@pytest.mark.parametrize("left_m", [2e-4, 6e-4, 1.5e-3])
def test_a_creep_that_stops_before_it_has_ended_says_by_how_much(left_m: float) -> None:
    creep_m = 0.01 * (1 - np.exp(-np.arange(4000) * PERIOD_S / 0.3))
    assert 0.5 * left_m < short_of(np.minimum(creep_m, 0.01 - left_m)) < 1.35 * left_m


def test_a_creep_that_ends_by_itself_and_a_way_at_a_constant_rate_are_not_short() -> None:
    assert short_of(0.01 * (1 - np.exp(-np.arange(6000) * PERIOD_S / 0.3))) < 2e-4 * STROKE_M
    assert short_of(np.minimum(0.01 * np.arange(4000) * PERIOD_S, 0.01)) == 0.0


def test_a_stem_that_goes_by_jumps_may_be_short_by_one() -> None:
    assert short_of(1e-3 * np.floor(np.minimum(np.arange(4000) * PERIOD_S, 0.5) / 0.12)) == pytest.approx(1e-3, rel=0.3)

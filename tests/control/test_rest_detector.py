"""Rest detection on made-up samples."""

import numpy as np
import pytest

from positioner.control.rest_detector import RestEstimate

RESOLUTION_M = 2e-5
AT_M = 0.06


def after(samples: np.ndarray, rest: RestEstimate | None = None) -> RestEstimate:
    rest = RestEstimate(RESOLUTION_M) if rest is None else rest
    for sample in samples.tolist():
        rest = rest.updated(sample)
    return rest


@pytest.mark.parametrize("noise_m", [0.0, 1e-5, 1e-4])
def test_a_stem_at_rest_is_found_at_its_place(noise_m: float) -> None:
    rest = after(AT_M + noise_m * np.random.default_rng(0).standard_normal(400))
    assert rest.known
    assert rest.std_m == pytest.approx(noise_m, rel=0.3, abs=1e-9)
    assert abs(rest.mean_m - AT_M) <= 4 * rest.error_m + 1e-9


def test_the_noise_decides_how_long_it_takes() -> None:
    lengths = []
    for noise_m in (1e-5, 1e-4):
        rng = np.random.default_rng(1)
        rest = after(AT_M + noise_m * rng.standard_normal(400)).restarted()
        n = 0
        while not rest.known:
            rest, n = rest.updated(AT_M + noise_m * rng.standard_normal()), n + 1
        lengths.append(n)
    assert lengths[0] <= 8
    assert 20 <= lengths[1] <= 90


def test_a_moving_stem_is_not_at_rest() -> None:
    noise_m = 1e-5
    rng = np.random.default_rng(2)
    rest = after(AT_M + noise_m * rng.standard_normal(400)).restarted()
    for sample in (AT_M + 2e-5 * np.arange(200) + noise_m * rng.standard_normal(200)).tolist():
        rest = rest.updated(sample)
        assert not rest.known


def test_a_step_begins_anew_and_is_found() -> None:
    noise_m = 1e-5
    rng = np.random.default_rng(3)
    rest = after(AT_M + noise_m * rng.standard_normal(400))
    rest = after(AT_M + 1e-4 + noise_m * rng.standard_normal(60), rest)
    assert rest.known
    assert rest.mean_m == pytest.approx(AT_M + 1e-4, abs=5e-6)


def test_ten_minutes_of_noise_never_look_like_a_step() -> None:
    """What re-arms the law is eight standard deviations of two blocks; a false one would be a pulse at rest."""
    noise_m = 1e-4
    rng = np.random.default_rng(4)
    rest = after(AT_M + noise_m * rng.standard_normal(400))
    worst = 0.0
    for sample in (AT_M + noise_m * rng.standard_normal(60_000)).tolist():
        rest = rest.updated(sample)
        if rest.known and not rest.block_count:
            worst = max(worst, abs(rest.mean_m - AT_M) / (rest.std_m / (2 * rest.length) ** 0.5))
    assert worst < 6.0

"""The friction estimator (22) and its means."""

import numpy as np
import pytest

from positioner.estimation.derivatives import weights
from positioner.estimation.friction_estimator import RunningMeans, friction
from tests.estimation.stem import THETA, A, B, C, K


@pytest.mark.parametrize("direction", [1, -1])
def test_what_the_equation_of_motion_leaves_over(direction: int) -> None:
    v, x, u = 0.013 * direction, 0.03, 4e4
    acceleration = A * v + B * x + C * u + K * direction
    assert friction(direction, acceleration, v, x, u, THETA) == pytest.approx(K, rel=1e-9)


def test_signs_as_printed_do_not_give_friction() -> None:
    v, x, u = 0.013, 0.03, 4e4
    acceleration = A * v + B * x + C * u + K
    assert acceleration + A * v + B * x - C * u != pytest.approx(K, rel=0.1)


def test_friction_of_the_means_is_the_mean_friction() -> None:
    rng = np.random.default_rng(0)
    samples = rng.normal(size=(20, 4))
    means = RunningMeans()
    for acceleration, v, x, u in samples.tolist():
        means.add(acceleration, v, x, u)
    mean = means.means(np.zeros((3, 6)))
    assert mean is not None
    each = [friction(-1, m, v, x, u, THETA) for m, v, x, u in samples.tolist()]
    of_means = friction(-1, mean.acceleration_m_per_s2, mean.velocity_m_per_s, mean.position_m, mean.pressure_pa, THETA)
    assert of_means == pytest.approx(np.mean(each))


def test_no_means_of_nothing() -> None:
    assert RunningMeans().means(np.zeros((3, 6))) is None


@pytest.mark.parametrize(("n", "count"), [(10, 100), (50, 300)])
def test_noise_of_the_filtered_mean_is_that_of_monte_carlo(n: int, count: int) -> None:
    filters = weights(np.arange(n, dtype=np.float64) / 1000)
    rng = np.random.default_rng(4)
    scatter = []
    for _ in range(400):
        noise = rng.normal(size=count + n - 1)
        windows = np.lib.stride_tricks.sliding_window_view(noise, n)
        scatter.append(np.mean(windows @ filters[1] - A * (windows @ filters[0]) - B * noise[n - 1 :]))
    means = RunningMeans()
    for _ in range(count):
        means.add(0.0, 0.0, 0.0, 0.0)
    mean = means.means(filters)
    assert mean is not None
    assert mean.filter_noise(A, B) == pytest.approx(np.std(scatter), rel=0.15)

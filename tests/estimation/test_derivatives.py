"""The derivative filters held against polynomials, the printed kernels and Monte Carlo."""

import numpy as np
import pytest

from positioner.estimation.derivatives import Derivatives, weights
from tests.estimation.stem import Array, grid

RNG = np.random.default_rng(1)
EVEN = 3.0 + 1e-3 * np.arange(50)
GRIDS = {
    "even": EVEN,
    "jitter": EVEN + RNG.uniform(-3e-4, 3e-4, 50),
    "same ends": np.concatenate((EVEN[:1], EVEN[1:-1] + RNG.uniform(-3e-4, 3e-4, 48), EVEN[-1:])),
    "missing": np.delete(EVEN, [3, 20, 21, 48]),
    "shortest": EVEN[:6],
    "long": 3.0 + 1e-5 * np.arange(500),
}


@pytest.mark.parametrize("name", GRIDS)
def test_exact_at_the_window_end_for_polynomials_on_any_grid(name: str) -> None:
    t = GRIDS[name]
    s = (t - t[0]) / (t[-1] - t[0])
    span = t[-1] - t[0]
    velocity, acceleration, slope = weights(t)
    parabola = np.polynomial.Polynomial([100.0, -3.0, 5.0])
    cubic = np.polynomial.Polynomial([100.0, -3.0, 5.0, 7.0])
    assert velocity @ parabola(s) * span == pytest.approx(parabola.deriv()(1.0), rel=1e-8)
    assert acceleration @ cubic(s) * span**2 == pytest.approx(cubic.deriv(2)(1.0), rel=1e-8)
    assert slope @ (100.0 - 3.0 * s) * span == pytest.approx(-3.0, rel=1e-8)


def test_kernels_are_the_printed_ones_run_backwards_in_the_limit() -> None:
    n, T = 8000, 0.05
    t = np.linspace(0.0, T, n)
    tau = T - t
    velocity, acceleration, _ = weights(t)
    k19 = -12 / T**4 * (3 * T**2 - 16 * T * tau + 15 * tau**2)
    k21 = 120 / T**6 * (4 * T**3 - 45 * T**2 * tau + 108 * T * tau**2 - 70 * tau**3)
    share = T / n
    np.testing.assert_allclose(velocity / share, -k19, atol=2e-3 * np.max(np.abs(k19)))
    np.testing.assert_allclose(acceleration / share, k21, atol=2e-3 * np.max(np.abs(k21)))


def test_printed_19_and_21_give_the_derivatives_at_the_start_of_the_window() -> None:
    import sympy as sp  # half a second: not in every worker that only collects this

    T, tau = sp.symbols("T tau", positive=True)
    x0, x1, x2, x3 = sp.symbols("x0:4")
    parabola = x0 + x1 * tau + x2 * tau**2 / 2
    cubic = parabola + x3 * tau**3 / 6
    first = -12 / T**4 * sp.integrate((3 * T**2 - 16 * T * tau + 15 * tau**2) * parabola, (tau, 0, T))
    second = sp.integrate((4 * T**3 - 45 * T**2 * tau + 108 * T * tau**2 - 70 * tau**3) * cubic, (tau, 0, T))
    assert sp.simplify(first - x1) == 0  # x'(0); the end would be x1 + x2 T
    assert sp.simplify(120 / T**6 * second - x2) == 0


@pytest.mark.parametrize("name", ["even", "jitter", "missing"])
def test_noise_gain_is_that_of_monte_carlo(name: str) -> None:
    t = GRIDS[name]
    derivatives = Derivatives()
    outputs = np.array([derivatives.estimate(t, x) for x in RNG.normal(size=(4000, len(t)))])
    assert derivatives.slope_gain == pytest.approx(np.std(outputs[:, 2]), rel=0.05)
    T = t[-1] - t[0]
    for output, gain in zip(
        outputs.T, (np.sqrt(192 / 50) / T, np.sqrt(25920 / 50) / T**2, np.sqrt(12 / 50) / T), strict=True
    ):
        assert np.std(output) == pytest.approx(gain, rel=0.15)


def test_weights_follow_the_grid() -> None:
    derivatives = Derivatives()
    for name in ("even", "same ends", "long", "even", "jitter", "missing", "even"):
        t = GRIDS[name]
        velocity, acceleration, _ = derivatives.estimate(t, 4.0 * (t - t[-1]) + 3.0 * (t - t[-1]) ** 2)
        assert velocity == pytest.approx(4.0, rel=1e-6)
        assert acceleration == pytest.approx(6.0, rel=1e-4)


def test_a_window_that_moves_on_has_the_weights_of_its_own_samples() -> None:
    steps = np.full(400, 1e-3)
    steps[150], steps[260] = 1.3e-3, 1.0004e-3
    steps[300:] *= np.linspace(1.0, 1.001, 100)
    t = np.cumsum(steps)
    x = RNG.normal(size=len(t))
    derivatives = Derivatives()
    for last in range(51, len(t)):
        window = slice(last - 51, last)
        expected = weights(t[window]) @ x[window]
        assert derivatives.estimate(t[window], x[window]) == pytest.approx(expected.tolist(), rel=1e-3, abs=1e-3)


def jerk(t: Array) -> Array:
    """A motion of one sign that begins with a jerk and goes on slowly."""
    after = np.maximum(t - 0.02, 0.0)
    return 0.01 * (1 - np.exp(-after / 0.004)) + 0.01 * after


def test_slope_keeps_the_sign_of_the_motion_where_the_parabola_does_not() -> None:
    t = grid(1e-3, 0, 0.199)
    windows = [weights(t[i : i + 50]) @ jerk(t[i : i + 50]) for i in range(150)]
    assert all(slope >= 0 for _, _, slope in windows)
    assert any(velocity < -0.01 for velocity, _, _ in windows)

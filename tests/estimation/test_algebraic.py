"""The running realisation held against direct integrals, exact motion and Monte Carlo."""

from collections.abc import Callable
from functools import cache
from math import factorial

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from positioner.estimation.algebraic import Identifier
from positioner.estimation.weighted_least_squares import Solution
from tests.cases import few_always
from tests.estimation.stem import (
    AREA,
    COULOMB,
    MASS,
    NOISE,
    PSI,
    SPRING,
    STATIC,
    STROKE,
    THETA,
    VISCOUS,
    Array,
    Run,
    grid,
    run,
    swing,
)

WINDOW = 0.8
RNG = np.random.default_rng(7)


@cache
def seed_run() -> Run:
    return run(swing, grid(1e-3, 0, WINDOW))


def identifier_of(samples: Run, *, held: bool = True) -> Identifier:
    identifier = Identifier(WINDOW, STROKE, 1e5, pressure_held=held)
    for sample in samples.samples():
        identifier.update(*sample)
    return identifier


def solution_of(samples: Run, noise_m: float = 1e-9, noise_pa: float = 0.0, *, held: bool = True) -> Solution:
    solution = identifier_of(samples, held=held).solve(noise_m, noise_pa)
    assert solution is not None
    return solution


def nfold(f: Callable[[Array], Array], n: int, knots: Array) -> float:
    """P(f, n) at the last knot by Cauchy's formula, Gauss-Legendre between the knots."""
    nodes, node_weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(knots)[:, None] / 2
    tau = knots[:-1, None] + half * (nodes + 1)
    return float(np.sum(half * node_weights * (knots[-1] - tau) ** (n - 1) / factorial(n - 1) * f(tau)))


@pytest.mark.parametrize("held", [True, False])
def test_running_realisation_is_the_direct_multiple_integral_on_an_uneven_grid(held: bool) -> None:
    t = np.cumsum(np.concatenate(([0.0], RNG.uniform(0.005, 0.04, 40))))
    xs, us = RNG.normal(size=len(t)), RNG.normal(size=len(t))
    identifier = Identifier(1.0, 1.0, 1.0, pressure_held=held)
    for sample in zip((t + 12.5).tolist(), xs.tolist(), us.tolist(), strict=True):
        identifier.update(*sample)
    columns = identifier.windows()[-1].columns
    q, P = columns[0], columns[1:].T

    def x(tau: Array) -> Array:
        return np.interp(tau, t, xs)

    def u(tau: Array) -> Array:
        return us[np.searchsorted(t, tau)] if held else np.interp(tau, t, us)

    for i in range(3):
        direct = (
            nfold(lambda s: -(s**3) * x(s), 1 + i, t) + 9 * nfold(lambda s: s**2 * x(s), 2 + i, t)
            + 18 * nfold(lambda s: -s * x(s), 3 + i, t) + 6 * nfold(x, 4 + i, t),
            nfold(lambda s: -(s**3) * x(s), 2 + i, t) + 6 * nfold(lambda s: s**2 * x(s), 3 + i, t)
            + 6 * nfold(lambda s: -s * x(s), 4 + i, t),
            nfold(lambda s: -(s**3) * x(s), 3 + i, t) + 3 * nfold(lambda s: s**2 * x(s), 4 + i, t),
            nfold(lambda s: -(s**3) * u(s), 3 + i, t) + 3 * nfold(lambda s: s**2 * u(s), 4 + i, t),
        )  # fmt: skip
        np.testing.assert_allclose([q[i], *P[i]], direct, rtol=1e-9, atol=1e-13)


def test_exact_motion_gives_exact_parameters() -> None:
    np.testing.assert_allclose(solution_of(seed_run()).theta, THETA, rtol=2e-5)


def test_sign_of_the_motion_does_not_matter() -> None:
    mirrored = Run(seed_run().time_s, -seed_run().position_m, -seed_run().pressure_pa)
    np.testing.assert_allclose(solution_of(mirrored).theta, solution_of(seed_run()).theta, rtol=1e-9)


@pytest.mark.parametrize("first", [1, 3, 7, 20])
def test_restart_at_any_instant_of_the_motion(first: int) -> None:
    identifier = Identifier(WINDOW, STROKE, 1e5)
    for i, sample in enumerate(seed_run().samples()):
        if i == first:
            identifier.restart()
        identifier.update(*sample)
    solution = identifier.solve(1e-9)
    assert solution is not None
    # The jerk is over after some 10 ms, and with it goes most of what tells a, b, c apart.
    np.testing.assert_allclose(solution.theta, THETA, rtol=1e-4 if first < 5 else 2e-3)
    assert identifier.elapsed_s == pytest.approx(WINDOW - first * 1e-3)


def test_a_grid_with_jitter_and_missing_samples_is_integrated_exactly() -> None:
    t = grid(1e-3, 0, WINDOW)
    t[1:-1] += RNG.uniform(-3e-4, 3e-4, len(t) - 2)
    t = t[(RNG.random(len(t)) > 0.02) | (t < 0.05)]
    solution = solution_of(run(swing, t))
    np.testing.assert_allclose(solution.theta, THETA, rtol=1e-3)
    # What a straight line leaves out over the longer steps is in the covariance.
    assert (np.abs(solution.theta - THETA) < 2 * np.sqrt(np.diag(solution.covariance))).all()


def test_a_time_stamp_that_does_not_advance_is_refused() -> None:
    identifier = identifier_of(seed_run())
    with pytest.raises(ValueError, match="not after the last sample"):
        identifier.update(*seed_run().samples()[-1])


def test_pressure_held_and_pressure_continuous_are_two_things() -> None:
    """Half a sample of delay in the pressure costs a, b, c more than a tenth, b/c nothing."""
    wrong = solution_of(seed_run(), held=False).theta
    assert abs(wrong[1] / THETA[1] - 1) > 0.1
    assert wrong[1] / wrong[2] == pytest.approx(THETA[1] / THETA[2], rel=1e-4)


def seeds_scenario() -> Run:
    """The seed's simulation at 10 us with its Stribeck term, pressure continuous."""

    def motion(time_s: float, state: Array) -> list[float]:
        x, v = state.tolist()
        friction = COULOMB + (STATIC - COULOMB) * np.exp(-((v / 2.54e-4) ** 2))
        return [v, (AREA * swing(time_s) - SPRING * x - VISCOUS * v - friction) / MASS]

    t = grid(1e-5, 0, WINDOW)
    solved = solve_ivp(
        motion, (0, WINDOW), [0.0, 1e-12], method="LSODA", t_eval=t, rtol=1e-9, atol=1e-12, max_step=1e-2
    )
    return Run(t, solved.y[0], PSI * (6.4 + 1.92 * np.sin(t)))


def test_the_seeds_scenario_without_noise_and_with_its_noise_taken_as_radians() -> None:
    clean = seeds_scenario()
    noisy = Run(clean.time_s, clean.position_m + 0.01 * STROKE * np.sin(1e5 * clean.time_s), clean.pressure_pa)
    np.testing.assert_allclose(solution_of(clean, held=False).theta, THETA, rtol=5e-4)
    np.testing.assert_allclose(solution_of(noisy, held=True).theta, THETA, rtol=7e-3)


FINE_RUN = run(swing, grid(5e-4, 0, WINDOW))
"""Fine enough for what straight lines leave out to count for nothing beside the noise."""


@pytest.mark.parametrize(
    ("noise_m", "noise_pa"), few_always([(5e-5 * STROKE, 20.0), (1e-4 * STROKE, 0.0), (0.0, 40.0)])
)
def test_covariance_is_that_of_the_scatter(noise_m: float, noise_pa: float) -> None:
    rng = np.random.default_rng(3)
    thetas = []
    for _ in range(35):
        noisy = FINE_RUN.noisy(rng, noise_m)
        pressure = noisy.pressure_pa + rng.normal(0, noise_pa, len(noisy.time_s))
        thetas.append(solution_of(Run(noisy.time_s, noisy.position_m, pressure), noise_m, noise_pa).theta)
    ratios = np.array([theta[1] / theta[2] for theta in thetas])
    solution = solution_of(FINE_RUN, noise_m, noise_pa)
    np.testing.assert_allclose(np.std(thetas, axis=0), np.sqrt(np.diag(solution.covariance)), rtol=0.3)
    gradient = np.array([0.0, 1 / THETA[2], -THETA[1] / THETA[2] ** 2])
    assert np.std(ratios) == pytest.approx(np.sqrt(gradient @ solution.covariance @ gradient), rel=0.3)


def test_covariance_where_viscous_friction_leads_on_an_uneven_grid_of_a_quarter_window() -> None:
    a, b, c = -60.0, -30.0, 50.0
    rng = np.random.default_rng(9)
    t = np.sort(rng.uniform(0, 1.0, 1500))
    u = rng.normal(size=21)[np.minimum((t * 20).astype(int), 20)]
    x, v, positions = 0.0, 0.0, [0.0]
    for h, force in zip(np.diff(t).tolist(), u[1:].tolist(), strict=True):
        step = expm(np.array([[0, 1, 0], [b, a, c * force], [0, 0, 0]]) * h)
        x, v = (step[:2] @ (x, v, 1.0)).tolist()
        positions.append(x)
    noise = 1e-4
    thetas, stds = [], []
    for _ in range(45):
        identifier = Identifier(4.0, 1.0, 1.0)
        noisy = np.array(positions) + rng.normal(0, noise, len(t))
        for sample in zip(t.tolist(), noisy.tolist(), u.tolist(), strict=True):
            identifier.update(*sample)
        solution = identifier.solve(noise)
        assert solution is not None
        thetas.append(solution.theta)
        stds.append(np.sqrt(np.diag(solution.covariance)))
    np.testing.assert_allclose(np.mean(thetas, axis=0), [a, b, c], rtol=0.05)  # x is not linear over the longest gaps
    np.testing.assert_allclose(np.std(thetas, axis=0), np.mean(stds, axis=0), rtol=0.3)


def test_bias_is_that_of_the_mean() -> None:
    """Errors in variables at 20 times the noise at which the covariance alone would do."""
    rng = np.random.default_rng(11)
    noise = 2e-3 * STROKE
    thetas = np.array([solution_of(FINE_RUN.noisy(rng, noise), noise).theta for _ in range(50)])
    solution = solution_of(FINE_RUN, noise)
    mean_error = np.mean(thetas, axis=0) - THETA
    uncertainty = np.std(thetas, axis=0) / np.sqrt(50)
    assert np.all(np.abs(mean_error - solution.bias) < 4 * uncertainty)


def test_noise_share_tells_when_the_parameters_are_lost() -> None:
    rng = np.random.default_rng(5)
    assert solution_of(seed_run().noisy(rng, NOISE), NOISE).noise_share < 0.02
    for _ in range(10):
        assert solution_of(seed_run().noisy(rng, 10 * NOISE), 10 * NOISE).noise_share > 0.05


def test_constant_pressure_is_singular_with_and_without_noise() -> None:
    constant = run(lambda _: 6.4 * PSI, grid(1e-3, 0, WINDOW))
    assert identifier_of(constant).solve(NOISE) is None
    assert identifier_of(constant.noisy(RNG)).solve(NOISE) is None
    assert Identifier(WINDOW, STROKE, 1e5).solve(NOISE) is None


def test_in_its_own_units_the_system_is_well_conditioned() -> None:
    """Condition 2e4, of nearly parallel b and c columns, where SI units make it a million million."""
    si = (
        identifier_of(seed_run()).windows()[-1].columns[1:].T
        * np.array([WINDOW**5, WINDOW**6, WINDOW**6 * 1e5 / STROKE])
        * WINDOW ** np.arange(3)[:, None]
    )
    assert solution_of(seed_run()).condition < 1e5
    assert np.linalg.cond(si) > 1e3 * solution_of(seed_run()).condition

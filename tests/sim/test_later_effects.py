"""The effects that measured actuators asked for, held against numbers worked out by hand."""

from math import log

import numpy as np
import pytest

from sim.effects import asymmetric_viscosity, presliding_hysteresis, pressure_power_friction
from tests.sim.library import SEED, Series, valve_with

F_S, K_S, A = SEED.valve.static_n, SEED.valve.spring_n_per_m, SEED.valve.diaphragm_area_m2
K_P = 3e6


def moved_m(loss: float, exponent: float, before_n: float, after_n: float, stiffness: float = 0.0) -> float:
    """Return how far a packing that balances one force yields when the external force becomes another."""
    q = presliding_hysteresis.Parameters(K_P, loss, exponent)
    z = np.array([1.0, before_n, F_S])
    return presliding_hysteresis.motion(after_n, stiffness, 0.0, 0.0, q, z)[0]


def test_the_way_between_two_forces_is_that_of_the_equation() -> None:
    loss, up = 0.8, 0.7 * F_S
    by_hand = F_S / (loss * K_P) * log((1.0 + loss * 0.2) / (1.0 - loss * 0.7))
    assert moved_m(loss, 1.0, -0.2 * F_S, up) == pytest.approx(by_hand, rel=1e-12)
    cubic = F_S / (loss * K_P) * ((1.0 - loss * 0.7) ** -2 - (1.0 + loss * 0.2) ** -2) / 2.0
    assert moved_m(loss, 3.0, -0.2 * F_S, up) == pytest.approx(cubic, rel=1e-12)
    assert moved_m(loss, 3.0, 0.2 * F_S, -up) == pytest.approx(-cubic, rel=1e-12), "the same the other way"


def test_against_a_spring_forces_balance_where_it_comes_to_rest() -> None:
    q, z = presliding_hysteresis.Parameters(K_P, 0.9, 3.0), np.array([1.0, -0.9 * F_S, F_S])
    x, _ = presliding_hysteresis.motion(0.95 * F_S, K_S, 0.0, 0.0, q, z)
    assert z[1] == pytest.approx(0.95 * F_S - K_S * x)
    assert x == pytest.approx(moved_m(0.9, 3.0, -0.9 * F_S, float(z[1])), rel=1e-6)


@pytest.mark.parametrize("loss", [0.01, 0.99])
def test_with_little_loss_it_is_elastic_and_with_much_it_is_not(loss: float) -> None:
    out, back = moved_m(loss, 1.0, 0.0, 0.8 * F_S), moved_m(loss, 1.0, 0.8 * F_S, 0.0)
    elastic = 0.8 * F_S / K_P
    if loss < 0.1:
        assert (out, -back) == pytest.approx((elastic, elastic), rel=0.01)
    else:
        assert out > 1.9 * elastic
        assert -back < 0.8 * elastic


def cycled_m(loss: float) -> Series:
    """Return where the stuck stem of a valve is over ten cycles of its pressure below break-away."""
    valve = valve_with("presliding_hysteresis", stiffness_n_per_m=K_P, loss=loss, exponent=3.0)
    swing = 0.7 * F_S / A * np.sin(2.0 * np.pi * np.arange(1001) / 100.0)
    return valve.run(swing, 1e-3).position_m


def test_a_stuck_stem_draws_a_loop() -> None:
    x = cycled_m(0.8)
    last, before = x[900:1000], x[800:900]
    np.testing.assert_allclose(last, before, atol=0.02 * float(np.ptp(last)))
    # At the same pressure, on the way up and down: the loop is open by far more than an elastic stem's is.
    opened = [float(np.ptp(each[[901, 951]]) / np.ptp(each[900:1000])) for each in (x, cycled_m(0.01))]
    assert opened[0] > 0.2 > 10.0 * opened[1]


def test_break_away_is_unchanged() -> None:
    for factor, slips in ((0.999, False), (1.001, True)):
        valve = valve_with("presliding_hysteresis", stiffness_n_per_m=1e3 * K_P, loss=0.9, exponent=3.0)
        valve.advance(factor * F_S / A, 5e-3)
        assert (valve.velocity_m_per_s != 0.0) == slips


def test_the_inverse_is_its_mean_stiffness_from_one_break_away_to_the_other() -> None:
    way_m = moved_m(0.9, 3.0, -F_S, F_S)
    q = presliding_hysteresis.Parameters(K_P, 0.9, 3.0)
    assert presliding_hysteresis.inverse(q).yielding_n_per_m == pytest.approx(2.0 * F_S / way_m)


def test_friction_grows_with_a_power_of_the_pressure() -> None:
    q = pressure_power_friction.Parameters(growth_n=200.0, exponent=2.0)
    levels = [pressure_power_friction.friction(1000.0, 1200.0, p, q) for p in (-5e4, 0.0, 1e5, 3e5)]
    assert levels == [(1000.0, 1200.0), (1000.0, 1200.0), (1200.0, 1400.0), (2800.0, 3000.0)]


@pytest.mark.parametrize(("extra", "velocity", "force_n"), [(50.0, 0.2, -10.0), (-50.0, -0.2, 10.0), (50.0, -0.2, 0.0)])
def test_one_direction_is_held_back_more_and_none_is_driven(extra: float, velocity: float, force_n: float) -> None:
    q = asymmetric_viscosity.Parameters(extra)
    assert asymmetric_viscosity.force(velocity, q) == pytest.approx(force_n)

"""A response held against measured positions: compiled as the text says, and as numpy would have it."""

from math import inf, nan

import numpy as np
import pytest

from config.valve_file import EffectTable, ValveFile, load_valve, shipped_valve
from sim import karnopp, misfit
from sim.composition import Composition
from sim.karnopp import TOLERANCE, Vector
from sim.misfit import AT_ONCE, Judge
from sim.open_loop import PATH_ROWS

SEED = load_valve(shipped_valve("seed"))
PERIODS = 3 * AT_ONCE + 11
COMMANDS = 6e4 * (1.0 + np.sin(np.arange(PERIODS) / 20.0))
SHOTS = np.array([[0.0, 0.01], [70.0, 0.03], [AT_ONCE * 2.0, 0.02], [float(PERIODS - 1), 0.0]])
JUDGE = Judge(sigma_m=1e-4, inside_m=0.0, hopeless_m=1.0, scale=5.0, limit=inf)
MEASURED_M = np.where(np.arange(PERIODS + 1) % 17 == 5, nan, 0.03)


def held_against(laws: object, composition: Composition, judge: Judge, shots: Vector) -> tuple[Vector, float, Vector]:
    """Return r, the cost and the state at the end."""
    state, errors, cost = np.zeros(composition.state_size), np.full(PERIODS + 1, nan), np.zeros(1)
    composition.rest(composition.theta, state, 0.0, 0.01, 0.0)
    path = np.empty((PATH_ROWS, AT_ONCE + 1))
    function = laws.misfit  # type: ignore[attr-defined]
    given = (composition.theta.copy(), state, COMMANDS, np.full(PERIODS, 5e-3), 5e-3, TOLERANCE)
    function(*given, shots, path, MEASURED_M, np.array(judge), errors, cost)
    return errors, float(cost[0]), state


def test_it_is_compiled_as_the_text_says() -> None:
    composition = Composition.from_file(SEED)
    judge = JUDGE._replace(inside_m=5e-4)
    plain, compiled = (held_against(laws, composition, judge, SHOTS) for laws in (misfit, composition.kernel))
    assert np.nanmax(np.abs(plain[0])) > 100.0
    for one, other in zip(plain, compiled, strict=True):
        np.testing.assert_array_equal(one, other)


def test_it_is_the_response_less_what_was_measured() -> None:
    lag = EffectTable.model_validate({"name": "ip_lag", "time_constant_s": 0.05})
    composition = Composition.from_file(ValveFile(valve=SEED.valve, effect=(lag,)))
    errors, cost, state = held_against(composition.kernel, composition, JUDGE, np.empty((0, 2)))
    expected, path = np.zeros(composition.state_size), np.empty((PATH_ROWS, PERIODS + 1))
    composition.rest(composition.theta, expected, 0.0, 0.01, 0.0)
    composition.kernel.respond(composition.theta, expected, COMMANDS, np.full(PERIODS, 5e-3), 5e-3, TOLERANCE, path)
    np.testing.assert_array_equal(errors, (path[4] - MEASURED_M) / JUDGE.sigma_m)
    known = errors[~np.isnan(errors)]
    assert cost == pytest.approx(np.sum(25.0 * (np.sqrt(1.0 + (known / 5.0) ** 2) - 1.0)), rel=1e-12)
    np.testing.assert_array_equal(state, expected)


def test_what_is_hopeless_or_no_number_counts_the_most() -> None:
    kernel = Composition.from_file(SEED).kernel
    shown, errors, cost = np.array([nan, inf, -inf, 2.0, 0.0]), np.empty(5), np.zeros(1)
    kernel.compare(shown, np.zeros(5), np.array(JUDGE), errors, cost)
    assert errors.tolist() == [1e4, 1e4, -1e4, 1e4, 0.0]


def test_the_nearest_pressure_holds_the_stem_where_a_sensor_shows_it() -> None:
    offset = EffectTable.model_validate({"name": "sensor_offset", "offset_m": 2e-3})
    composition = Composition.from_file(ValveFile(valve=SEED.valve, effect=(offset,)))
    rests = karnopp.read(composition.begin(composition.theta, 1.0, 0.052, 0.0, 0.0))
    valve = karnopp.karnopp(composition.theta)
    assert rests.x == pytest.approx(0.05)
    assert rests.indicated == pytest.approx(0.052)
    assert valve.A * rests.p == pytest.approx(valve.k_s * rests.x - valve.F_s)
    moves = karnopp.read(composition.begin(composition.theta, 1.0, 0.03, -0.2, 0.0))
    assert (moves.mode, moves.v, moves.sigma) == (karnopp.SLIP, -0.2, -1.0)
    assert valve.A * moves.p == pytest.approx(valve.k_s * moves.x - 0.2 * valve.F_v - valve.F_c)

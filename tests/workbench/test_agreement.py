"""Agreement of searches, on a made-up error of three coordinates with a least that is known."""

from collections.abc import Iterable
from typing import Any, cast

import numpy as np
import pytest

from sim.karnopp import Vector
from workbench.fit.agreement import Place, agreeing
from workbench.fit.descent import NARROW, descended, scanned, settled
from workbench.fit.objective import FINAL, SimulationError, soft
from workbench.fit.quanta import proved

BEST = np.array([0.3, -0.2, 0.1])


class MadeUp:
    """500 residuals linear in the first two coordinates, blind to the third, on stairs in the second."""

    lower, upper = np.full(3, -2.0), np.full(3, 2.0)
    parameters = ()

    def __init__(self, stairs: float = 0.0, second: float = np.inf) -> None:
        generator = np.random.default_rng(0)
        self._noise = generator.standard_normal(500)
        self._slopes = 100.0 * generator.standard_normal((500, 3)) * [1.0, 1.0, 0.0]
        self._stairs = stairs
        self._second = second
        """First coordinate about which there is another valley, a hair worse in cost."""

    def theta(self, z: Vector) -> Vector:
        return z

    def residuals(self, z: Vector, scale: float = FINAL) -> Vector:
        apart = z - BEST
        if apart[0] > 0.5 * self._second:
            apart = apart - [self._second, 0.0, 0.0]
        if self._stairs:
            apart[1] = self._stairs * np.round(apart[1] / self._stairs)
        return np.asarray(self._noise + self._slopes @ apart)

    def cost(self, z: Vector, scale: float = FINAL) -> float:
        return soft(self.residuals(z), scale)

    def least(self, places: Iterable[Vector], scale: float = FINAL) -> Vector:
        return min(places, key=lambda z: self.cost(z, scale))

    def jacobian(self, z: Vector, here: Vector, step: float) -> Vector:
        return np.array([(self.residuals(z + step * each) - here) / step for each in np.eye(3)]).T


def made_up(**kinds: float) -> SimulationError:
    return cast(SimulationError, cast(Any, MadeUp(**kinds)))


def test_searches_of_one_origin_count_once() -> None:
    error = made_up()
    assert agreeing(error, [Place(BEST, "base fit 1"), Place(BEST, "base fit 1"), Place(BEST, "base fit 1")]) == 1
    assert agreeing(error, [Place(BEST, "base fit 1"), Place(BEST, "odd landings"), Place(BEST, "base fit 1")]) == 2


def test_a_search_by_all_slips_is_none_beside_those_by_halves_of_them() -> None:
    error = made_up()
    assert agreeing(error, [Place(BEST, "slips"), Place(BEST, "odd slips")]) == 1
    assert agreeing(error, [Place(BEST, "slips"), Place(BEST, "odd slips"), Place(BEST, "even slips")]) == 2
    assert agreeing(error, [Place(BEST, "slips"), Place(BEST, "base fit 1")]) == 2


def test_the_same_cost_elsewhere_is_no_agreement() -> None:
    error = made_up(second=0.8)
    elsewhere = BEST + np.array([0.8, 0.0, 0.0])
    assert error.cost(elsewhere) == pytest.approx(error.cost(BEST))
    assert agreeing(error, [Place(BEST, "even landings"), Place(elsewhere, "odd landings")]) == 1


def test_a_higher_cost_is_no_agreement() -> None:
    error = made_up()
    assert (
        agreeing(error, [Place(BEST, "even landings"), Place(BEST + np.array([0.009, 0.0, 0.0]), "odd landings")]) == 1
    )


def test_what_the_record_does_not_determine_may_lie_anywhere() -> None:
    error = made_up()
    assert agreeing(error, [Place(BEST, "even landings"), Place(BEST + np.array([0.0, 0.0, 1.5]), "odd landings")]) == 2


def test_a_search_goes_over_stairs_that_no_derivative_sees() -> None:
    error = made_up(stairs=0.02)
    begin = BEST + np.array([0.02, 0.03, 0.0])
    assert scanned(error, begin, 1)[1] == pytest.approx(BEST[1], abs=0.01)
    found = settled(error, begin)
    np.testing.assert_allclose(found[:2], BEST[:2], atol=0.01)
    assert error.cost(found) < 1.01 * error.cost(BEST)


class Rounded(MadeUp):
    """The same, each residual rounded to 20: stairs run across all coordinates."""

    def residuals(self, z: Vector, scale: float = FINAL) -> Vector:
        return np.asarray(self._noise + 20.0 * np.round(self._slopes @ (z - BEST) / 20.0))


def test_searches_on_one_stair_of_a_rounded_record_do_not_agree_once_a_lower_one_is_found() -> None:
    error = cast(SimulationError, cast(Any, Rounded()))
    stuck = BEST + np.array([0.05, -0.08, 0.0])
    stuck = descended(error, stuck, NARROW)
    ends = [Place(stuck, "even landings"), Place(stuck, "odd landings"), Place(stuck, "base fit 1")]
    assert error.cost(stuck) > 1.01 * error.cost(BEST), "a descent ends there"
    assert agreeing(error, ends) == 3
    best, *others = proved(error, ends)
    assert error.cost(best.z) < error.cost(stuck) / 1.01
    assert agreeing(error, [best, *others]) == 1


def test_at_the_least_of_a_rounded_record_searches_go_on_agreeing() -> None:
    error = cast(SimulationError, cast(Any, Rounded()))
    assert agreeing(error, proved(error, [Place(BEST, "even landings"), Place(BEST, "odd landings")])) == 2

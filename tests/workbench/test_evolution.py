"""Places evolve off stairs about an end, and from afar into a valley that no search began in."""

from typing import Any, cast

import numpy as np
import pytest

from sim.composition import SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.fit.evolution import evolved, evolved_from_afar, evolved_inside
from workbench.fit.objective import FINAL, SimulationError
from workbench.model.parameters import Parameter

PARAMETERS = (
    Parameter("spring_n_per_m", SPRING, 1.0, 1e6),
    Parameter("viscous_ns_per_m", VISCOUS, 1.0, 1e6),
    Parameter("lag.time_s", STATIC + 7, 1e-3, 1e3),
)
HERE, TRUTH = np.array([0.0, 0.0, 0.0]), np.array([0.004, 1.1, -0.9])


class TwoValleys:
    """A wide valley at 0, where searches end, and far off, viscous friction against a lag, a deeper one."""

    parameters = PARAMETERS
    lower, upper = np.full(3, -4.0), np.full(3, 4.0)
    asked: list[Vector]

    def __init__(self) -> None:
        self.rough, self.asked = self, []

    def cost(self, z: Vector, scale: float = FINAL) -> float:
        self.asked.append(z)
        wide = 1.0 + float(np.sum(((z - HERE) / np.array([0.1, 1.0, 1.0])) ** 2))
        deep = float(np.sum(((z - TRUTH) / np.array([0.003, 0.3, 0.3])) ** 2))
        return min(wide, deep)


class Stairs:
    """Residuals that are rounded: a derivative sees their slope, and no way down."""

    parameters = PARAMETERS
    lower, upper = np.full(3, -1.0), np.full(3, 1.0)
    slopes = 1e3 * np.random.default_rng(3).standard_normal((40, 3))

    def residuals(self, z: Vector, scale: float = FINAL) -> Vector:
        return np.asarray(np.round(self.slopes @ z / 20.0) * 20.0 + 0.01 * self.slopes @ z)

    def jacobian(self, z: Vector, here: Vector, step: float) -> Vector:
        return self.slopes

    def cost(self, z: Vector, scale: float = FINAL) -> float:
        return float(np.sum(self.residuals(z) ** 2))


class Rounded:
    """A sensor that rounds what is linear: each position in a wrong quantum counts, or how far it is outside."""

    parameters = (*PARAMETERS[:2], Parameter("rounding.quantum_m", STATIC + 7, 0.0, 1.0, guess="quantum"))
    lower, upper = np.full(3, -2.0), np.full(3, 2.0)
    slopes = np.random.default_rng(4).standard_normal((600, 2))
    measured = np.round(slopes @ np.array([0.7, -0.4]) * 20.0)
    asked: list[Vector]

    def __init__(self, *, outside: bool) -> None:
        self._outside, self.asked = outside, []

    def residuals(self, z: Vector, scale: float = FINAL) -> Vector:
        self.asked.append(z)
        off = np.abs(20.0 * self.slopes @ z[:2] - self.measured)
        return np.asarray(np.maximum(off - 0.5, 0.0) if self._outside else np.round(off) + 0.01 * off)

    def jacobian(self, z: Vector, here: Vector, step: float) -> Vector:
        return np.column_stack([20.0 * self.slopes, np.ones(len(self.slopes))])

    def cost(self, z: Vector, scale: float = FINAL) -> float:
        return float(np.sum(self.residuals(z) ** 2))


def as_error(made_up: TwoValleys | Stairs | Rounded) -> SimulationError:
    return cast(SimulationError, cast(Any, made_up))


@pytest.mark.parametrize("last_bits", range(4))
def test_from_afar_places_evolve_into_the_deeper_valley(last_bits: int) -> None:
    """The best of them do not lead: they are drawn to the wide one, where the search is already."""
    error, z = TwoValleys(), HERE + 1e-12 * last_bits
    best = evolved_from_afar(as_error(error), z, [[np.array([0.0, 0.0, -1.0])], [np.array([0.0, 0.0, 1.0])]])[0]
    assert best == pytest.approx(TRUTH, abs=0.5)
    assert all((error.lower <= each).all() and (each <= error.upper).all() for each in error.asked)


def test_about_an_end_places_evolve_off_the_stairs() -> None:
    error, stuck = as_error(Stairs()), np.array([0.02, -0.03, 0.025])
    found = evolved(error, stuck, 40, 60)
    assert error.cost(found) < 0.1 * error.cost(stuck)
    assert error.cost(evolved(error, found, 40, 60)) <= error.cost(found), "nowhere does it end higher than it began"


def test_the_end_itself_decides_what_is_drawn() -> None:
    """So that a fit is the same whenever it is made, and whatever was fitted before."""
    first, again, other = (TwoValleys() for _ in range(3))
    for error, z in ((first, HERE), (again, HERE), (other, HERE + 1e-9)):
        evolved_from_afar(as_error(error), z, [])
    assert np.array_equal(first.asked, again.asked)
    assert not np.allclose(first.asked[1], other.asked[1])


def test_where_a_sensor_rounds_places_evolve_by_what_lies_outside_its_quanta_which_stay() -> None:
    rounded, outside, stuck = Rounded(outside=False), Rounded(outside=True), np.array([0.72, -0.41, 0.3])
    found = evolved_inside(as_error(rounded), as_error(outside), stuck, 60, 60)
    assert rounded.cost(stuck) > 10.0
    assert rounded.cost(found) < 1.0, "every position in its quantum"
    assert {float(each[2]) for each in outside.asked} == {stuck[2]}
    nowhere = evolved_inside(as_error(rounded), as_error(TwoValleys()), found, 10, 2)
    assert np.array_equal(nowhere, found), "what leads higher is not followed"

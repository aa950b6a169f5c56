"""Places evolve off stairs about an end, and from afar into a valley that no search began in."""

from typing import Any, cast

import numpy as np
import pytest

from sim.composition import SPRING, STATIC, VISCOUS
from sim.karnopp import Vector
from workbench.fit.evolution import evolved, evolved_from_afar
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


def as_error(made_up: TwoValleys | Stairs) -> SimulationError:
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

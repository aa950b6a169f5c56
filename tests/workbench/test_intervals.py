"""Intervals hold where the valve scatters from slip to slip, and where only the sensor is noisy: rates over draws."""

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from config.recording import Column
from sim.composition import Composition
from sim.karnopp import Vector
from tests.cases import few_always
from tests.workbench.valves import SLIM, creeping, record_of
from workbench.data.motion import Directions, slips
from workbench.data.record import Record, ready
from workbench.fit.objective import SimulationError, soft
from workbench.fit.uncertainty import uncertainty
from workbench.model.free_run import FreeRun
from workbench.model.parameters import free_parameters

DRAWS = 100
TELL = 6
"""Every so many slips one that tells of the parameter."""


class Straight(SimulationError):
    """An error that is a straight line in its one coordinate, true at 0."""

    def __init__(self, record: Record, slope: Column, wrong: Column) -> None:
        composition = Composition.from_file(SLIM)
        super().__init__(
            FreeRun(composition, record), composition, free_parameters(composition, ["coulomb_n"]), composition.theta
        )
        self.lower, self.upper = np.array([-5.0]), np.array([5.0])
        self._slope, self._wrong = slope, wrong

    def compared(self, z: Vector, scale: float, limit: float) -> tuple[Vector, float]:
        apart = np.asarray(self._wrong + self._slope * z[0])
        return apart, soft(apart, scale)

    def by_slips(self, *_: object) -> "Straight":
        return self

    def held(self) -> bool:
        """Whether the interval about the least holds the truth."""
        least = minimize_scalar(lambda z: self.cost(np.array([z])), bounds=(-2.0, 2.0), method="bounded").x
        found = uncertainty(self, np.array([float(least)]))
        return bool(found.lower[0] <= 0.0 <= found.upper[0])


@pytest.fixture(scope="module")
def record() -> Record:
    return ready(record_of(SLIM, 7, command_pa=creeping()))


@pytest.fixture(scope="module")
def slip(record: Record) -> Directions:
    """The slip that each sample belongs to."""
    firsts = [each.first for each in slips(record.position_m, record.scale_m)]
    return np.searchsorted(firsts, np.arange(len(record)), side="right")


@pytest.mark.parametrize("scatter", few_always([3.0, 0.0]))
def test_the_truth_lies_inside_in_nineteen_of_twenty(record: Record, slip: Directions, scatter: float) -> None:
    generator = np.random.default_rng(1)
    slope = np.where(slip % TELL == 0, 10.0, 0.1)
    held = 0
    for _ in range(DRAWS):
        own = scatter * generator.standard_normal(slip.max() + 1) * np.where(np.arange(slip.max() + 1) % TELL, 1.0, 4.0)
        held += Straight(record, slope, own[slip] + generator.standard_normal(slip.size)).held()
    assert held >= 0.85 * DRAWS, "by samples alone 63 of 100, where the valve scatters"

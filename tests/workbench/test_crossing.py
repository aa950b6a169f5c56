"""Ends of searches that lie along one valley are crossed: what they differ by leads to its floor."""

import numpy as np
import pytest

from benchmarks.searches import Case, posed, true_cost
from sim.composition import COULOMB, STATIC
from sim.karnopp import Vector
from workbench.fit.agreement import WITHIN
from workbench.fit.crossing import FAR, PARTNERS, crossed, leaves_noise, sticking, unlike
from workbench.fit.fitting import fit
from workbench.model.parameters import Parameter


class Box:
    """The bounds of two coordinates, and whose they are."""

    lower, upper = np.array([-1.0, -1.0]), np.array([1.0, 1.0])
    parameters: tuple[Parameter, ...] = ()


def test_places_lie_between_the_ends_and_beyond_the_best() -> None:
    found = crossed(Box(), [np.array([0.0, 0.5]), np.array([0.4, 0.9])])  # type: ignore[arg-type]
    assert np.array(found) == pytest.approx(np.array([[0.2, 0.7], [-0.2, 0.3], [-0.8, -0.3]]))


def test_no_place_lies_outside_the_bounds_and_of_many_ends_the_best_are_crossed() -> None:
    ends = [np.full(2, 0.9), *(np.full(2, -0.1 * i) for i in range(9))]
    found = np.array(crossed(Box(), ends))  # type: ignore[arg-type]
    assert len(found) == 3 * PARTNERS + PARTNERS * (PARTNERS - 1)
    assert found.max() == 1.0


def test_of_ends_that_have_come_to_the_same_one_counts() -> None:
    best, same, apart = np.array([0.1, 0.2]), np.array([0.1, 0.20005]), np.array([0.1, 0.21])
    assert [each.tolist() for each in unlike([best, same, apart])] == [best.tolist(), apart.tolist()]


class Left:
    """What a search has left."""

    def __init__(self, left: Vector) -> None:
        self.residuals = lambda _: left


def test_where_noise_is_left_there_is_nothing_to_go_on_for() -> None:
    noise = np.random.default_rng(2).standard_normal(3000)
    late = noise + 6.0 * (np.arange(3000) == 1000)
    slow = noise + 0.5 * np.sin(0.01 * np.arange(3000))
    verdicts = [leaves_noise(Left(left), np.zeros(2)) for left in (noise, 0.5 * noise, late, slow)]  # type: ignore[arg-type]
    assert verdicts == [True, True, False, False]


def test_static_friction_is_tried_on_other_treads_and_nothing_where_it_is_kept() -> None:
    box = Box()
    box.parameters = (Parameter("coulomb_n", COULOMB, 1.0, 2.0), Parameter("static_n", STATIC, 1.0, 5.0))
    places = np.array(sticking(box, np.array([0.1, 0.5])))  # type: ignore[arg-type]
    assert (places[:, 0] == 0.1).all()
    assert np.sort(places[:, 1] - 0.5) == pytest.approx(np.sort([*FAR, *-FAR]))
    box.parameters = box.parameters[:1]
    assert sticking(box, np.array([0.1])) == []  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "case",
    [
        Case("flow_force", 140479, "poor"),
        pytest.param(Case("backlash", 140198, "poor"), marks=pytest.mark.long),
        pytest.param(Case("asymmetric_friction", 150255, "poor"), marks=pytest.mark.long),
    ],
)
def test_searches_that_end_apart_in_one_valley_come_to_its_floor(case: Case) -> None:
    """Of twelve slips, 4 % to 41 times above the truth: walls so steep that no derivative on the floor points along."""
    recording, valve, truth = posed(case)
    base = fit(recording, valve, workers=1, profile=False)
    found = fit(recording, valve, effects=(case.effect,), workers=1, base=base, profile=False)
    assert found.cost < WITHIN * true_cost(recording, truth)

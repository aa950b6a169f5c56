"""Ends of searches that lie along one valley are crossed: what they differ by leads to its floor."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.searches import Case, posed, true_cost
from sim.composition import COULOMB, STATIC
from sim.karnopp import Vector
from workbench.fit.crossing import FAR, PARTNERS, crossed, leaves_noise, sticking, unlike
from workbench.fit.fitting import fit
from workbench.fit.objective import WITHIN
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
    """What a search has left, of a record whose command repeats itself or does not."""

    def __init__(self, left: Vector, repeats_m: float | None = None) -> None:
        self.residuals = lambda _: left
        self.rms_m = lambda _: float(np.sqrt(np.mean(left**2)))
        self.sigma_m = 1.0
        self.run = SimpleNamespace(record=SimpleNamespace(repeatability_m=repeats_m))


def test_where_noise_is_left_there_is_nothing_to_go_on_for() -> None:
    noise = np.random.default_rng(2).standard_normal(3000)
    late = noise + 6.0 * (np.arange(3000) == 1000)
    slow = noise + 0.5 * np.sin(0.01 * np.arange(3000))
    verdicts = [leaves_noise(Left(left), np.zeros(2)) for left in (noise, 0.5 * noise, late, slow)]  # type: ignore[arg-type]
    assert verdicts == [True, True, False, False]


@pytest.mark.parametrize(("repeats_m", "goes_on"), [(None, True), (5.0, False), (3.0, True), (1.5, True)])
def test_where_a_valve_scatters_no_more_is_left_than_it_differs_by_from_itself(
    repeats_m: float | None, goes_on: bool
) -> None:
    """Of 4 noises that go on from sample to sample; less than two noises of scatter may be noise alone."""
    left = 4.0 * np.repeat(np.random.default_rng(2).standard_normal(300), 10)
    assert leaves_noise(Left(left, repeats_m), np.zeros(2)) is not goes_on  # type: ignore[arg-type]


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
        Case("asymmetric_friction", 150255, "poor"),
        Case("flow_force", 140479, "poor"),
        Case("sensor_lag", 180462, "poor"),
        Case("stribeck", 210309, "poor"),
        pytest.param(Case("sensor_lag", 180339, "poor"), marks=pytest.mark.long),
        pytest.param(Case("backlash", 140198, "poor"), marks=pytest.mark.long),
        pytest.param(Case("dwell_stiction", 180126, "full"), marks=pytest.mark.long),
    ],
)
def test_searches_that_end_apart_come_to_the_floor(case: Case) -> None:
    """They ended 4 % to 46 times above the truth: in a valley so steep that no derivative on its floor points along,
    with viscous friction off by half and more (the sensor's lag), or let be on stairs above the base (dwell). What
    flow force came to, the last bits of another processor decided; Stribeck friction was left at the base's cost."""
    recording, valve, truth = posed(case)
    base = fit(recording, valve, workers=1, profile=False)
    found = fit(recording, valve, effects=(case.effect,), workers=1, base=base, profile=False)
    assert found.cost < WITHIN * true_cost(recording, truth)

"""Intervals hold where the valve scatters from move to move, and where only the sensor is noisy: rates over draws."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from config.recording import Column
from sim.composition import Composition
from sim.karnopp import Vector
from tests.cases import few_always
from tests.workbench.valves import SLIM, record_of
from workbench.blind.hiding import hide
from workbench.data.record import ready
from workbench.fit.ends import search_about
from workbench.fit.fit_problem import problem
from workbench.fit.fit_result import Counted, terms
from workbench.fit.fit_thresholds import FIT, Effort
from workbench.fit.fitting import fit
from workbench.fit.likelihood import Groups, Likelihood, cost_of, soft
from workbench.fit.minimiser import End, derivatives, descend
from workbench.fit.uncertainty import uncertainty

DRAWS = 100
TELL = 6
"""Every so many moves one that tells of the parameter."""


class Straight:
    """A likelihood that is a straight line in its one coordinate, true at 0."""

    def __init__(self, like: Likelihood, slope: Vector) -> None:
        self._like, self._slope = like, slope
        groups = like.at(like.composition.theta, like.run.first_onsets_s())
        self._splits = np.cumsum([each.size for each in groups])[:-1]

    def held(self, wrong: Vector) -> bool:
        """Whether the interval about the least holds the truth, of residuals that are wrong by so much there."""

        def rows(z: float) -> Vector:
            return np.asarray(wrong + self._slope * z)

        least = minimize_scalar(lambda z: float(soft(rows(z)).sum()), bounds=(-2.0, 2.0), method="bounded").x
        r = rows(float(least))
        groups = Groups(*np.split(r, self._splits))
        end = End(np.array([float(least)]), np.empty(0), float(soft(r).sum()), groups, self._slope[:, None])
        found = uncertainty(self._like, end)
        return bool(found.lower[0] <= 0.0 <= found.upper[0])


def to_and_fro() -> Column:
    """Return a command of many moves, Pa: steps up and down, each held for half a second."""
    base, generator = SLIM.valve, np.random.default_rng(0)
    share = 0.5 + np.where(np.arange(80) % 2, 0.3, -0.3) * generator.uniform(0.5, 1.0, 80)
    return np.repeat(share * base.spring_n_per_m * base.stroke_m / base.diaphragm_area_m2, 50)


@pytest.fixture(scope="module")
def like() -> Likelihood:
    record = ready(record_of(SLIM, 7, command_pa=to_and_fro()))
    return problem(record, SLIM.valve).likelihood(Composition.from_file(SLIM), ["coulomb_n"])


@pytest.mark.parametrize("scatter", few_always([3.0, 0.0]))
def test_the_truth_lies_inside_in_nineteen_of_twenty(like: Likelihood, scatter: float) -> None:
    generator = np.random.default_rng(1)
    move_of, moves = like.move_of, len(like.moves)
    straight = Straight(like, np.where(move_of % TELL == 0, 10.0, 0.1))
    held = 0
    for _ in range(DRAWS):
        own = scatter * generator.standard_normal(moves + 1) * np.where(np.arange(moves + 1) % TELL, 1.0, 4.0)
        held += straight.held(own[move_of] + generator.standard_normal(like.count))
    assert held >= 0.9 * DRAWS, "by samples alone 63 of 100 where the valve scatters, by as many degrees as moves 87"


def test_moves_in_a_row_that_share_a_disturbance_are_fewer_witnesses(like: Likelihood) -> None:
    generator = np.random.default_rng(2)
    straight = Straight(like, np.ones(like.count))
    held = 0
    for _ in range(DRAWS):
        shared = np.convolve(generator.standard_normal(len(like.moves) + 3), np.ones(3), "valid")
        held += straight.held(3.0 * shared[like.move_of] + generator.standard_normal(like.count))
    assert held >= 0.85 * DRAWS, "each of them a witness by itself: 73 of 100"


def test_a_combination_names_who_takes_part_in_it_and_by_which_power() -> None:
    """Jacobians that are blind to (0.85, 0.4, 0.33, 0.1): what takes part by a tenth is not worth a word."""
    record = ready(record_of(SLIM, 7, command_pa=to_and_fro()))
    names = ["spring_n_per_m", "coulomb_n", "viscous_ns_per_m", "mass_kg"]
    like = problem(record, SLIM.valve).likelihood(Composition.from_file(SLIM), names)
    open_ = np.array([0.85, 0.4, 0.33, 0.1])
    open_ /= np.linalg.norm(open_)
    seen = np.random.default_rng(1).standard_normal((like.count, 4)) @ (np.eye(4) - np.outer(open_, open_))
    groups = like.at(like.composition.theta, like.run.first_onsets_s())
    z = like.coordinates(like.composition.theta)
    (found,) = uncertainty(like, End(z, np.empty(0), cost_of(groups.whole), groups, seen)).undetermined
    assert found.names == tuple(each.name for each in like.parameters[:3])
    assert found.powers == pytest.approx(open_[:3] / open_[0])


def test_each_landing_break_away_and_parameter_that_moved_is_one_witness(like: Likelihood) -> None:
    """Samples in motion hang together and count for fewer; a rest is one, however long."""
    groups = like.at(like.composition.theta, like.run.first_onsets_s())
    counted = Counted(groups, like.layout.rest_of, len(like.moves))
    found = terms(counted, np.array([0.3, -2.0, 1.0]))
    assert found.landings.independent == groups.landings.size
    assert found.break_aways.independent == groups.break_aways.size
    assert found.moved.independent == 3
    assert found.rests.independent == np.unique(like.layout.rest_of).size
    assert len(like.moves) <= found.motion.independent <= groups.motion.size


def test_what_only_a_sum_of_two_coordinates_tells_is_open_in_their_difference(like: Likelihood) -> None:
    """An onset that nothing hangs on does not hide it: columns of any length are weighed alike."""
    onsets_s = like.run.first_onsets_s()
    groups = like.at(like.composition.theta, onsets_s)
    rows = groups.whole.size
    generator = np.random.default_rng(2)
    shared = 1e3 * generator.standard_normal((rows, 1))
    onsets = np.zeros((rows, onsets_s.size))
    onsets[:, 0] = 1e-9
    twofold = problem(like.record, SLIM.valve).likelihood(Composition.from_file(SLIM), ["coulomb_n", "spring_n_per_m"])
    end = End(np.zeros(2), onsets_s, 0.0, groups, np.hstack([shared, shared, onsets]))
    found = uncertainty(twofold, end)
    assert np.all(found.std > 1.0)
    assert found.std.max() < 10.0


def test_an_end_is_believed_where_no_place_that_it_leaves_open_leads_lower(like: Likelihood) -> None:
    stopped = descend(like, like.coordinates(like.composition.theta) + 0.05, effort=Effort(0, 1.0))
    begun = replace(stopped, jacobian=derivatives(like, stopped.z, stopped.onsets_s))
    found = search_about(like, begun)
    assert found.cost < begun.cost - 1.0
    assert all(other.cost < found.cost + FIT.intervals.rise_nats for other in found.as_likely)
    assert search_about(like, begun).cost == found.cost, "the places drawn are the same each time"


def test_an_interval_reaches_over_another_end_that_is_as_likely(like: Likelihood) -> None:
    end = descend(like, like.coordinates(like.composition.theta))
    alone = uncertainty(like, end)
    other = replace(end, z=end.z + 3.0 * alone.std, cost=end.cost + 0.5 * FIT.intervals.rise_nats)
    both = uncertainty(like, replace(end, as_likely=(other,)))
    assert both.upper[0] > other.z[0]
    assert both.lower[0] == alone.lower[0]


def test_static_friction_takes_on_what_is_open_of_an_excess_at_rest() -> None:
    """A break-away tells F_s + F_x: of an excess lost faster than any sample shows, F_s may be the whole or less."""
    hidden = hide(81026, effects=("stribeck",))
    static = fit(hidden.fit, hidden.base, effects=["stribeck"]).parameters["static_n"]
    assert static.lower <= hidden.truth.valve.static_n <= static.upper


@pytest.mark.parametrize("seed", few_always([52035, 52001, 52018]))
def test_static_friction_is_not_below_all_that_noise_has_broken_loose_early(seed: int) -> None:
    hidden = hide(seed, effects=seed % 2, dirty=True)
    static = fit(hidden.fit, hidden.base, effects=[each.name for each in hidden.truth.effect]).parameters["static_n"]
    assert static.lower <= hidden.truth.valve.static_n <= static.upper

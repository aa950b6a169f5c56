"""The likelihood of a record that is told when its stem moves: no stairs, and static friction in an interval."""

from dataclasses import replace

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import ValveFile, load_valve, shipped_valve
from sim.composition import COULOMB, STATIC, Composition
from tests.simulated import simulated
from tests.workbench.valves import NOISE_M, SEED, record_of, with_effect
from workbench.data.record import Record, ready
from workbench.fit.fit_problem import problem
from workbench.fit.fit_thresholds import FIT
from workbench.fit.fitting import fit
from workbench.fit.likelihood import Likelihood, cost_of, layout, soft, soft_weight
from workbench.fit.minimiser import Ground, Place, minimise
from workbench.fit.onsets import with_onsets
from workbench.model.free_run import FreeRun
from workbench.model.told_run import ToldRun, told_moves

LAG = with_effect(SEED, "ip_lag", time_constant_s=0.15)
STOP = {"lower_m": 0.0, "travel_m": 0.6 * SEED.valve.stroke_m, "stiffness_n_per_m": 5e6, "damping_ns_per_m": 1e4}
YIELDS = with_effect(SEED, "presliding", stiffness_n_per_m=1.5e6)


def steps() -> Column:
    """Return a command of few moves, Pa: steps and ramps, and rests between them."""
    places = [(0.0, 0.2, 1), (2.0, 0.2, 1), (2.01, 0.6, 1), (5.0, 0.6, 1), (8.0, 0.3, -1), (10.0, 0.3, -1)]
    places += [(13.0, 0.75, 1), (15.0, 0.75, 1), (15.01, 0.25, -1), (18.0, 0.25, -1), (20.0, 0.5, 1), (22.0, 0.5, 1)]
    valve = SEED.valve
    at_s, share, way = np.array(places).T
    balance_pa = (valve.spring_n_per_m * valve.stroke_m * share + way * valve.coulomb_n) / valve.diaphragm_area_m2
    command_pa: Column = np.interp(np.arange(0.0, 22.0, 0.01), at_s, balance_pa)
    return command_pa


def recording(file: ValveFile, seed: int = 3) -> Recording:
    return record_of(file, seed, command_pa=steps())


def ramps() -> Column:
    """Return a command of two moves, Pa: a signature, slowly up and down again."""
    span_pa = SEED.valve.spring_n_per_m * SEED.valve.stroke_m / SEED.valve.diaphragm_area_m2
    command_pa: Column = span_pa * np.interp(np.arange(0.0, 21.0, 0.01), [0.5, 10.0, 11.0, 20.5], [0.1, 0.9, 0.9, 0.1])
    return command_pa


def test_what_creeps_has_moved_but_has_not_broken_loose() -> None:
    """A servo motor's packing gave way by 6 noises under a quarter of its friction: no model breaks loose there."""
    time_s = 0.01 * np.arange(1200.0)
    generator = np.random.default_rng(4)
    gone = 60.0 * (time_s > 3.0) + 9.0 * np.clip((time_s - 7.0) / 0.3, 0.0, 1.0)
    position_m = 0.05 + NOISE_M * (gone + generator.standard_normal(1200))
    command_pa = 1e5 + 1e4 * (time_s > 3.0) + 1e3 * (time_s > 7.0)
    record = ready(Recording({"time_s": time_s, "command_pa": command_pa, "position_m": position_m}))
    moves = told_moves(record)
    assert [round(time_s[each.after]) for each in moves] == [3, 7]
    assert list(layout(record, moves).broken) == [0]


def likelihood(file: ValveFile, record: Record) -> Likelihood:
    return problem(record, file.valve).likelihood(Composition.from_file(file))


@pytest.mark.parametrize(
    "file", [SEED, LAG, YIELDS, with_effect(SEED, "end_stop", **STOP), with_effect(SEED, "preload", force_n=300.0)]
)
def test_told_when_it_moves_the_true_valve_leaves_the_noise(file: ValveFile) -> None:
    record = ready(recording(file))
    like = likelihood(file, record)
    _, groups = with_onsets(like, like.composition.theta)
    assert len(like.moves) >= 4
    for each in (groups.motion, groups.rests):
        assert np.sqrt(np.mean(each**2)) < 1.25
    assert np.sqrt(np.mean(groups.landings**2)) < 2.0
    assert groups.break_aways.max(initial=0.0) < 2.0


def test_a_ramp_does_not_carry_on_a_stem_that_is_told_to_rest() -> None:
    """Without Stribeck's term it slid from slip to slip, 10 noises away from a stem that sticks."""
    valve = load_valve(shipped_valve("ordinary"))
    time_s = np.arange(0.0, 20.0, 0.03)
    up_and_down_pa = 60e3 + 2.3e3 * (10.0 - np.abs(time_s - 10.0))
    record = ready(simulated(valve, time_s, up_and_down_pa, noise_std_m=4e-5, seed=1))
    like = likelihood(valve, record)
    _, groups = with_onsets(like, like.composition.theta)
    assert len(like.moves) > 30
    assert np.sqrt(np.mean(groups.landings**2)) < 2.0


def test_static_friction_has_no_part_in_when_a_told_stem_moves() -> None:
    record = ready(recording(SEED))
    like = likelihood(SEED, record)
    theta = like.composition.theta.copy()
    onsets_s = like.run.first_onsets_s()
    before = like.run.run(theta, onsets_s)
    theta[STATIC] *= 1.1
    after = like.run.run(theta, onsets_s)
    assert np.abs(before.indicated_m - after.indicated_m).max() < NOISE_M, "only where a slide dies away"


def test_each_break_away_has_static_friction_between_what_the_rest_bore_and_what_broke_it_loose() -> None:
    record = ready(recording(SEED))
    like = likelihood(SEED, record)
    theta = like.composition.theta
    path = like.run.run(theta, with_onsets(like, theta)[0])
    allowed_n = 0.03 * theta[COULOMB]
    assert np.all(path.bears_n <= theta[STATIC] + allowed_n)
    assert np.all(path.breaks_n >= theta[STATIC] - allowed_n)
    assert np.any(path.breaks_n - path.bears_n < allowed_n), "a ramp tells it closely"


def test_a_slip_that_a_free_run_mistimes_costs_the_likelihood_what_its_break_away_is_off() -> None:
    record = ready(recording(SEED))
    like, composition = likelihood(SEED, record), Composition.from_file(SEED)
    free = FreeRun(composition, record)
    onsets_s, _ = with_onsets(like, composition.theta)
    told, alone = [], []
    for share in np.linspace(0.97, 1.03, 31):
        theta = composition.theta.copy()
        theta[STATIC] *= share
        told.append(float(soft(like.at(theta, onsets_s).whole).sum()))
        error_m = free.position_m(theta) - record.position_m
        alone.append(float(soft(error_m[record.valid] / NOISE_M).sum()))
    assert np.ptp(alone) > 20.0 * np.ptp(told)
    assert np.all(np.diff(told, 2) > -0.2), "convex but for the noise: there is one end"


def test_a_rest_is_held_whatever_the_command_says_of_it() -> None:
    record = ready(recording(SEED))
    record = replace(record, command_pa=record.command_pa + 2e4)
    run = ToldRun(Composition.from_file(SEED), record, told_moves(record))
    first = run.moves[0]
    rest = run.run(Composition.from_file(SEED).theta, run.first_onsets_s()).indicated_m[: first.before]
    assert np.ptp(rest) < 1e-9


@pytest.mark.parametrize("scale", [0.5, 3.0, FIT.weights.soft_noises])
def test_the_cost_is_a_parabola_at_the_noise_a_line_beyond_and_its_slope_is_the_weight(
    scale: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    weights = replace(FIT.weights, soft_noises=scale)
    monkeypatch.setattr("workbench.fit.likelihood.FIT", replace(FIT, weights=weights))
    r, step = np.linspace(-20.0, 20.0, 401), 1e-5
    slope = (soft(r + step) - soft(r - step)) / (2.0 * step)
    np.testing.assert_allclose(soft_weight(r) * r, slope, atol=1e-8)
    small, large = np.array([0.0, 1e-3 * scale]), np.array([1e4 * scale])
    np.testing.assert_allclose(soft(small), 0.5 * small**2, rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(soft(large), scale * large, rtol=1e-3)


def test_a_slow_ramp_each_way_tells_spring_and_friction() -> None:
    record = record_of(SEED, 3, command_pa=ramps())
    assert len(told_moves(ready(record))) == 2
    off = SEED.valve.model_copy(update={"spring_n_per_m": 6e4, "coulomb_n": 1500.0, "static_n": 1900.0})
    found = fit(record, ValveFile(valve=off)).parameters
    for name in ("spring_n_per_m", "coulomb_n"):
        assert found[name].value == pytest.approx(getattr(SEED.valve, name), rel=2e-3)


@pytest.mark.parametrize("seed", range(4))
def test_a_search_goes_on_over_edges_finer_than_its_steps(seed: int) -> None:
    """Teeth of a thousandth on a bowl: slopes over a tenth of one know nothing of the bowl."""
    phase = np.random.default_rng(seed).uniform(0.0, 1.0, 40)

    def rows(at: Place) -> np.ndarray:
        bowl = [10.0 * at.z[0], 3.0 * at.z[1], 5.0 * (at.z[0] - at.z[1])]
        return np.concatenate([bowl, 0.3 * ((1e3 * (at.z[0] + 0.7 * at.z[1]) + phase) % 1.0)])

    none, begin = np.empty(0), np.array([1.0, -0.7])
    ground = Ground(rows, np.zeros(43, dtype=np.int64), Place(begin - 5.0, none), Place(begin + 5.0, none))
    end = minimise(ground, Place(begin, none), FIT.descent.whole)
    assert cost_of(rows(end)) < 0.5 * cost_of(rows(Place(begin, none)))

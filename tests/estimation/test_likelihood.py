"""The maximum-likelihood fit: exact without noise, at the bound with it, honest about what it cannot know."""

from itertools import pairwise
from math import exp

import numpy as np
import pytest

from config.codes import Refusal
from config.valve_file import load_valve, shipped_valve
from positioner.estimation.batch import BatchResult, BatchSettings, even_instants, identify
from positioner.estimation.likelihood import fit_motions
from positioner.estimation.segmentation import find_motions
from positioner.estimation.stem_response import responses, roots
from sim.valve import Valve
from tests.cases import few_always
from tests.estimation.stem import COULOMB, NOISE, PSI, STATIC, STROKE, TRUTH, A, Array, B, C, K, Run, grid, run, swing

NAMES = tuple(TRUTH)
HELD = BatchSettings(pressure_held=True)
TAU, MU = A / B, -1 / B


def moved(period_s: float = 1e-3, rest_s: float = 0.1) -> Run:
    return run(swing, grid(period_s, -rest_s, 0.8), fine_s=period_s)


def found(each: Run, settings: BatchSettings = HELD) -> BatchResult:
    return identify(each.time_s, each.position_m, each.pressure_pa, settings)


def errors(each: BatchResult) -> list[float]:
    return [getattr(each.estimates, name).value / TRUTH[name] - 1 for name in NAMES]


def reasons(each: BatchResult) -> list[Refusal]:
    return [getattr(each.estimates, name).reason for name in NAMES]


def bounds(each: Run, noise_m: float) -> Array:
    """Cramér-Rao for a, b, c, k, b/c, k/c with the start known: differences of the exact response."""
    start = int(np.flatnonzero(each.pressure_pa)[0]) - 1
    t, u = each.time_s[start:], each.pressure_pa[start:]

    def position(logs: Array) -> Array:
        a, b, c, k = (np.array([A, B, C, K]) * np.exp(logs)).tolist()
        X_g, X_q, _, _ = responses(t, u, 1, a / b, -1 / b, held=True)
        return np.asarray(-c / b * X_g - k / b * X_q)

    J = np.array([(position(step) - position(-step)) / 2e-5 for step in 1e-5 * np.eye(4)]).T
    covariance = noise_m**2 * np.linalg.inv(J.T @ J)
    gradients = np.vstack((np.eye(4), [[0, 1, -1, 0], [0, 0, -1, 1]]))
    return np.asarray(np.sqrt(np.einsum("ij,jk,ik->i", gradients, covariance, gradients)))


def at_once(time_s: Array) -> Run:
    """Return the motion from rest at 0 until time 0, whatever the steps: by the response, which the next test holds."""
    start = int(np.flatnonzero(time_s >= 0)[0])
    pressure_pa = np.append(0.0, [swing(each) for each in time_s[:-1].tolist()])
    X_g, X_q, _, _ = responses(time_s[start:], pressure_pa[start:], 1, TAU, MU, held=True)
    moving = -C / B * X_g - K / B * X_q
    return Run(time_s, np.concatenate((np.zeros(start), moving)), pressure_pa)


@pytest.mark.parametrize(("tau", "mu"), [(TAU, MU), (2 * MU**0.5, MU), (0.3 * MU**0.5, MU), (TAU, 1e-4 * TAU**2)])
def test_the_response_obeys_its_differential_equation(tau: float, mu: float) -> None:
    """Overdamped, equal roots, ringing, hardly any mass; uneven steps: against steps a thousand times finer."""
    rng = np.random.default_rng(0)
    coarse = np.cumsum(np.append(0.0, rng.uniform(0.5e-3, 1.5e-3, 40)))
    u = rng.normal(size=41)
    fine = np.unique(np.concatenate([np.linspace(a, b, 50) for a, b in pairwise(coarse.tolist())]))
    for held in (True, False):
        shown = u[np.searchsorted(coarse, fine)] if held else np.interp(fine, coarse, u)
        many = responses(fine, shown, 1, tau, mu, held=held)
        few = responses(coarse, u, 1, tau, mu, held=held)
        at = np.searchsorted(fine, coarse)
        for one, other in zip(few, many, strict=True):
            np.testing.assert_allclose(one, other[at], atol=1e-9 * np.abs(one).max())
    lambdas = roots(tau, mu)
    np.testing.assert_allclose(mu * lambdas**2 + tau * lambdas + 1, 0, atol=1e-4)


@pytest.mark.parametrize("period_s", [1e-3, 5e-3])
def test_without_noise_it_is_exact(period_s: float) -> None:
    each = found(moved(period_s), BatchSettings(noise_std_m=1e-9, pressure_held=True))
    assert max(map(abs, errors(each))) < 1e-6
    assert reasons(each) == [Refusal.VALID] * 6


@pytest.mark.parametrize(("period_s", "noise_pu"), few_always([(5e-3, 1e-3), (1e-3, 1e-4), (1e-3, 0.01 / 2**0.5)]))
def test_it_reaches_the_bound_and_says_so(period_s: float, noise_pu: float) -> None:
    """18 runs know a standard deviation to 17 %; 1.2 and three times that."""
    noise_m, clean = noise_pu * STROKE, moved(period_s)
    runs = [found(clean.noisy(np.random.default_rng(seed), noise_m)) for seed in range(18)]
    off, at = np.array([errors(each) for each in runs]), bounds(clean, noise_m)
    said = [[getattr(each.estimates, name).std / abs(TRUTH[name]) for name in NAMES] for each in runs]
    assert (off.std(axis=0) < 1.2 * 1.5 * at).all()
    assert (np.abs(off.mean(axis=0)) < (0.5 + 3 / 18**0.5) * at).all()
    assert (np.abs(off) < np.array(said)).mean() == pytest.approx(0.68, abs=0.18)


def test_stamps_that_jitter_are_taken_for_what_they_are() -> None:
    """Samples taken evenly whose stamps are off, and samples taken unevenly whose stamps are true."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        even = at_once(grid(1e-3, -0.1, 0.8)).noisy(rng)
        off = Run(even.time_s + 1e-4 * rng.uniform(-1, 1, 901), even.position_m, even.pressure_pa)
        uneven_s = grid(1e-3, -0.1, 0.8) + 1e-4 * rng.uniform(-1, 1, 901)
        uneven = at_once(uneven_s - uneven_s[100]).noisy(rng)
        kept = rng.uniform(size=901) >= 0.01
        fits = [found(each.kept(kept)) for each in (even, off, uneven)]
        assert [fit.evened for fit in fits] == [False, True, False]
        assert max(map(abs, errors(fits[1]))) < 5e-3


def test_evened_stamps_keep_the_gaps() -> None:
    rng = np.random.default_rng(0)
    even_s = grid(1e-3, 0.0, 0.5)
    keep = rng.uniform(size=501) >= 0.05
    stamps_s = (even_s + 5e-5 * rng.uniform(-1, 1, 501))[keep]
    again_s = even_instants(stamps_s)
    assert again_s is not None
    np.testing.assert_allclose(again_s, even_s[keep], atol=1e-5)
    assert even_instants(even_s) is None
    assert even_instants(np.cumsum(rng.exponential(1e-3, 500))) is None


def test_the_sample_at_which_it_broke_away_is_lost() -> None:
    whole = moved().noisy(np.random.default_rng(5))
    keep = np.ones(len(whole.time_s), dtype=np.bool_)
    keep[100] = False
    each = found(whole.kept(keep))
    assert each.fit is not None
    assert each.fit.start_s[0] == pytest.approx(0.0, abs=1e-5)
    assert max(map(abs, errors(each))) < 0.01


def test_at_20_ms_only_the_ratios_are_known() -> None:
    each = found(run(swing, grid(0.02, -0.4, 0.8)).noisy(np.random.default_rng(1)))
    assert reasons(each) == [Refusal.MASS_NOT_IDENTIFIABLE] * 4 + [Refusal.VALID] * 2
    assert max(map(abs, errors(each)[4:])) < 0.01


def test_behind_a_lag_of_0_3_s_only_the_ratios_are_known() -> None:
    def lagged(time_s: float) -> float:
        return swing(time_s) * (1 - exp(-time_s / 0.3)) if time_s > 0 else 0.0

    fine = run(lagged, grid(2.5e-4, -0.1, 1.0))
    rows = slice(None, None, 4)
    seen = Run(fine.time_s[rows], fine.position_m[rows], fine.pressure_pa[rows]).noisy(np.random.default_rng(1))
    for settings in (BatchSettings(), BatchSettings(pressure_held=False)):
        each = found(seen, settings)
        assert reasons(each) == [Refusal.MASS_NOT_IDENTIFIABLE] * 4 + [Refusal.VALID] * 2
        assert max(map(abs, errors(each)[4:])) < 0.01


def test_a_command_that_is_not_the_pressure_does_not_fit() -> None:
    fine = run(lambda t: swing(t) * (1 - exp(-t / 0.3)) if t > 0 else 0.0, grid(1e-3, -0.1, 1.0))
    command = np.array([swing(t - 1e-3) for t in fine.time_s.tolist()])
    each = found(Run(fine.time_s, fine.position_m, command).noisy(np.random.default_rng(1)))
    assert set(reasons(each)) == {Refusal.MODEL_DOES_NOT_FIT}


def stick_slip(time_s: float) -> float:
    """Up by a sine, held, down, up again: stick and reversal within one record."""
    if time_s < 0.5:
        return swing(time_s)
    return 8.5 * PSI if time_s < 0.9 else 1.0 * PSI if time_s < 1.3 else 14.0 * PSI


def swung(until_s: float) -> Run:
    """Return the simulator's motion, which sticks as Karnopp has it."""
    time_s = grid(1e-3, -0.1, until_s)
    held = np.array([stick_slip(each) if each > -1e-9 else 0.0 for each in time_s[:-1].tolist()])
    response = Valve.from_file(load_valve(shipped_valve("seed"))).run(held, 1e-3)
    return Run(time_s, response.position_m, np.append(0.0, held))


def test_rest_and_reversal_are_cut_out() -> None:
    whole = swung(1.7).noisy(np.random.default_rng(2))
    pieces = find_motions(whole.time_s, whole.position_m, whole.pressure_pa, NOISE, 1e-3).segments
    assert [piece.direction for piece in pieces] == [1, -1, 1]
    assert [float(piece.time_s[piece.begins]) for piece in pieces] == pytest.approx([0.0, 0.9, 1.3], abs=1e-3)
    each = found(whole)
    assert max(map(abs, errors(each))) < 0.005
    assert reasons(each) == [Refusal.VALID] * 6


def test_a_stop_in_the_way_is_cut_out() -> None:
    whole = run(swing, grid(1e-3, -0.1, 0.8))
    stopped = Run(whole.time_s, np.minimum(whole.position_m, 0.033), whole.pressure_pa)
    assert (stopped.position_m == 0.033).sum() > 200
    each = found(stopped.noisy(np.random.default_rng(2)))
    assert max(map(abs, errors(each)[4:])) < 0.01
    assert reasons(each)[4:] == [Refusal.VALID] * 2


def test_breaking_away_under_a_ramp_tells_the_static_friction() -> None:
    whole = run(lambda t: 25e3 + 20e3 * t if t > 0 else 0.0, grid(1e-3, -0.1, 1.5)).noisy(np.random.default_rng(2))
    swings = swung(1.7).noisy(np.random.default_rng(3))
    shift = float(whole.time_s[-1]) + 1.0
    both = [
        np.concatenate(pair) for pair in ((whole.time_s, swings.time_s + shift), (whole.position_m, swings.position_m))
    ]
    each = identify(both[0], both[1], np.concatenate((whole.pressure_pa, swings.pressure_pa)), HELD)
    known = each.estimates.breakaway
    assert known.valid
    assert known.value == pytest.approx(STATIC / 0.0645, abs=4 * known.std + 20)
    assert known.value > 1.1 * COULOMB / 0.0645


def test_nothing_moves_nothing_is_known() -> None:
    still = run(lambda t: 1e4 if t > 0 else 0.0, grid(1e-3, -0.1, 0.5)).noisy(np.random.default_rng(1))
    each = found(still)
    assert set(reasons(each)) == {Refusal.WAITING_FOR_MOTION}
    assert each.fit is None
    assert fit_motions([], held=True) is None


def test_samples_that_are_no_numbers_are_missing_samples() -> None:
    whole = moved().noisy(np.random.default_rng(1))
    whole.position_m[300:310] = np.nan
    assert max(map(abs, errors(found(whole)))) < 0.01


def test_a_motion_that_begins_the_record_is_found_on_whatever_clock() -> None:
    rows: Array = np.arange(300, dtype=np.float64)
    for zero_s in (0.0, 1e7, 1.76e9):
        t: Array = zero_s + 0.01 * rows + 1e7 * (rows > 150)
        position_m: Array = 1e-4 * rows
        pressure_pa: Array = 100.0 * rows
        ramp = identify(t, position_m, pressure_pa, HELD)
        assert ramp.estimates.b_over_c.value == pytest.approx(-1e6, rel=1e-6)

"""What drives a stem between two samples of its pressure: against a lag by hand, and under a supply's noise."""

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import EffectTable, valve
from sim.composition import Composition
from sim.open_loop import respond
from tests.cases import few_always
from workbench.blind.hiding import hide
from workbench.data.pressure_lag import without_gaps_pa
from workbench.data.record import ready
from workbench.model.free_run import FreeRun
from workbench.model.pressure_between_samples import means_between_samples_pa
from workbench.model.simulation_regime import Motion

SEED = valve("seed")
PERIOD_S, FINE = 0.01, 200
COMMAND_PA = np.repeat([30e3, 60e3, 20e3, 45e3, 80e3, 50e3], 60)


def lagging(lag_s: float, noise_pa: Column) -> tuple[Column, Column]:
    """Return samples of a pressure behind a lag, and its means between them; the noise is a line between samples."""
    h = PERIOD_S / FINE
    p, samples_pa, means_pa = COMMAND_PA[0], [], []
    for u in COMMAND_PA.tolist():
        samples_pa.append(p)
        passed = [p := u + (p - u) * np.exp(-h / lag_s) for _ in range(FINE)]
        means_pa.append(np.mean(passed))
    return np.array(samples_pa) + noise_pa, np.array(means_pa) + 0.5 * (noise_pa + np.append(noise_pa[1:], 0.0))


@pytest.mark.parametrize("lag_s", [1e-4, 5e-3, 0.05, 1.0])
def test_the_mean_behind_a_lag_that_nobody_told(lag_s: float) -> None:
    noise_pa = 300.0 * np.convolve(
        np.random.default_rng(1).normal(size=COMMAND_PA.size + 19), np.ones(20) / 20, "valid"
    )
    pressure_pa, mean_pa = lagging(lag_s, noise_pa)
    found_pa = means_between_samples_pa(PERIOD_S, COMMAND_PA, pressure_pa, ((0, COMMAND_PA.size),), 1)[:, 0]
    assert np.max(np.abs(found_pa - mean_pa)[:-1]) < 250.0
    assert np.sqrt(np.mean((found_pa - mean_pa)[:-1] ** 2)) < 40.0


@pytest.mark.parametrize("lag_s", [1e-4, 0.05])
def test_a_transmitter_whose_zero_is_off_does_not_kick_the_stem_at_the_start(lag_s: float) -> None:
    """The command was followed from the pressure at the start: 100 kPa less, and back, within the first sample."""
    pressure_pa, _ = lagging(lag_s, np.full(COMMAND_PA.size, 1e5))
    found_pa = means_between_samples_pa(PERIOD_S, COMMAND_PA, pressure_pa, ((0, COMMAND_PA.size),), 5)
    assert np.max(np.abs(found_pa[:10] - pressure_pa[0])) < 100.0


def test_stretches_are_no_steps_of_each_other() -> None:
    pressure_pa, _ = lagging(0.02, np.zeros(COMMAND_PA.size))
    alone_pa = means_between_samples_pa(PERIOD_S, COMMAND_PA, pressure_pa, ((0, 180), (180, COMMAND_PA.size)), 1)[:, 0]
    assert alone_pa[179] == pressure_pa[179]
    assert alone_pa[-1] == pressure_pa[-1]


def test_in_parts_it_is_the_same_on_the_mean() -> None:
    noise_pa = 300.0 * np.random.default_rng(2).standard_normal(COMMAND_PA.size)
    pressure_pa, _ = lagging(0.008, noise_pa)
    whole, parts = (
        means_between_samples_pa(PERIOD_S, COMMAND_PA, pressure_pa, ((0, COMMAND_PA.size),), each) for each in (1, 5)
    )
    assert np.allclose(parts.mean(axis=1), whole[:, 0], atol=1e-6)
    leaps = np.flatnonzero(np.diff(COMMAND_PA)) + 1
    assert np.all(np.abs(parts[leaps, -1] - COMMAND_PA[leaps]) < np.abs(parts[leaps, 0] - COMMAND_PA[leaps]))


@pytest.mark.parametrize("seed", few_always([32004, 37158]))
def test_by_the_measured_pressure_a_true_valve_leaves_a_quarter_of_what_a_noisy_supply_makes_of_it(seed: int) -> None:
    """Steps that arrive within a sample were taken for half of them, and left three times as much."""
    made = hide(seed, dirty=True, pressure=True)
    composition = Composition.from_file(made.truth)
    record = ready(made.fit)
    left_m = {
        by: np.abs(FreeRun(composition, record, from_pressure=by).position_m(composition.theta) - record.position_m)
        for by in (False, True)
    }
    assert np.nanmedian(left_m[True]) < np.nanmedian(left_m[False]) / 4.0
    assert np.nanmean(left_m[True] ** 2) < 0.5 * np.nanmean(left_m[False] ** 2)


@pytest.mark.parametrize("lag_s", [1e-4, 0.05])
def test_a_gap_in_the_measured_pressure_is_what_was_commanded_in_it(lag_s: float) -> None:
    """A straight line over it missed every step of two seconds: the stem stood where it was 20 kPa away from."""
    pressure_pa, _ = lagging(lag_s, np.zeros(COMMAND_PA.size))
    known = np.ones(COMMAND_PA.size, dtype=np.bool_)
    known[:2] = known[100:290] = known[-5:] = False
    line_pa = np.interp(np.arange(COMMAND_PA.size), np.flatnonzero(known), pressure_pa[known])
    time_s: Column = PERIOD_S * np.arange(COMMAND_PA.size, dtype=np.float64)
    whole_pa = without_gaps_pa(time_s, COMMAND_PA, line_pa, ((0, 210), (210, COMMAND_PA.size)), known)
    assert np.array_equal(whole_pa[known], pressure_pa[known])
    assert np.max(np.abs(whole_pa - pressure_pa)) < 500.0
    assert np.max(np.abs(line_pa - pressure_pa)) > 1e4


@pytest.mark.parametrize("lag_s", [0.3, 1.5, 5.0])
def test_seen_once_a_second_a_stem_goes_with_the_measured_pressure(lag_s: float) -> None:
    """Taken for all at once, it left 0.4 to 2 mm of a true valve: it landed where the pressure was a second later."""
    levels_pa = np.repeat(np.random.default_rng(4).uniform(9e3, 70e3, 30), 8)
    lag = EffectTable.model_validate({"name": "ip_lag", "time_constant_s": lag_s})
    lagging = Composition.from_file(SEED.model_copy(update={"effect": (lag,)}))
    answer = respond(lagging, lagging.theta, levels_pa[:-1], 1.0, step_s=2e-3)
    noise_m = 3e-5 * np.random.default_rng(5).standard_normal(levels_pa.size)
    columns = {"command_pa": levels_pa, "position_m": answer.indicated_m + noise_m, "pressure_pa": answer.pressure_pa}
    record = ready(Recording({"time_s": np.arange(levels_pa.size, dtype=np.float64), **columns}))
    bare = Composition.from_file(SEED)
    run = FreeRun(bare, record, from_pressure=True)
    assert run.by.motion is Motion.QUASI_STATIC
    off_m = run.position_m(bare.theta) - record.position_m
    assert np.sqrt(np.nanmean(off_m**2)) < 2e-4

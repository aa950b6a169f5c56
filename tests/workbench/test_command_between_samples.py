"""Whether a command changed between samples, where it ramps so evenly that no movement begins early."""

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import ValveFile
from sim.composition import Composition
from sim.open_loop import respond
from tests.workbench.slow_records import SPAN_PA, once_a_second
from tests.workbench.valves import NOISE_M, SEED, with_effect
from workbench.data.held_out import split
from workbench.data.noise_floor import with_noise
from workbench.data.record import Record, ready
from workbench.model.command_between_samples import part_of_the_way
from workbench.model.free_run import FreeRun
from workbench.model.simulation_regime import Motion, sampling
from workbench.select.effect_search import EffectSearch

CALM = SEED.model_copy(update={"valve": SEED.valve.model_copy(update={"coulomb_n": 300.0, "static_n": 400.0})})
STUCK = SEED.valve.model_copy(update={"coulomb_n": 3.0 * SEED.valve.coulomb_n, "static_n": 3.0 * SEED.valve.static_n})
SECONDS, ACTS_S = 300, 0.05
HELD = [
    CALM,
    with_effect(CALM, "asymmetric_friction", asymmetry=0.15),
    with_effect(CALM, "spring_hardening", cubic_n_per_m3=8e5),
    with_effect(CALM, "position_friction", growth=0.4, travel_m=0.1016),
    with_effect(CALM, "friction_drift", rate_per_s=0.008),
    with_effect(CALM, "ip_lag", time_constant_s=0.4),
]
NAMES = ["nothing", "asymmetric_friction", "spring_hardening", "position_friction", "friction_drift", "ip_lag"]


def ramping(file: ValveFile, acts_s: float) -> Recording:
    """Record a command that goes evenly from level to level, changed every `acts_s`, and the stem, once a second."""
    generator = np.random.default_rng(3)
    time_s = acts_s * np.arange(round(SECONDS / acts_s))
    turns_s = np.cumsum(generator.uniform(4.0, 14.0, SECONDS))
    command_pa: Column = SPAN_PA * np.interp(time_s, turns_s, generator.uniform(0.1, 0.9, SECONDS))
    composition = Composition.from_file(file)
    response = respond(composition, composition.theta, command_pa[:-1], acts_s, step_s=0.05)
    rows = slice(None, None, round(1.0 / acts_s))
    position_m: Column = response.indicated_m[rows] + NOISE_M * generator.standard_normal(SECONDS)
    columns = {"time_s": np.arange(float(SECONDS)), "command_pa": command_pa[rows], "position_m": position_m}
    return with_noise(Recording(columns), NOISE_M)


@pytest.mark.parametrize("file", HELD[:-1], ids=NAMES[:-1])
def test_a_command_that_ramps_between_samples_is_seen_to(file: ValveFile) -> None:
    found = sampling(ready(ramping(file, ACTS_S)), CALM.valve)
    assert (found.motion, found.held) == (Motion.LANDINGS, False)
    assert "of the way" in found.sentence


@pytest.mark.parametrize("file", HELD, ids=NAMES)
def test_a_command_that_ramps_by_steps_held_from_sample_to_sample_is_held(file: ValveFile) -> None:
    """Whatever the valve file lacks: what is missing is no sign of the next command."""
    record = ready(ramping(file, 1.0))
    assert sampling(record, CALM.valve).motion is Motion.QUASI_STATIC
    assert sampling(record, SEED.valve).sure
    part = part_of_the_way(record)
    assert part is not None
    assert part.held
    assert part.part < 2.0 * part.std + 0.02


def wandering(seed: int) -> Recording:
    """Record a command that ramps, held from sample to sample, and a stem at rest at its balance when each ends; its
    friction wanders up and down by a third."""
    generator = np.random.default_rng(seed)
    time_s: Column = np.asarray(0.5 * np.arange(600), np.float64)
    turns_s = np.cumsum(generator.uniform(4.0, 14.0, 100))
    command_pa: Column = SPAN_PA * np.interp(time_s, turns_s, generator.uniform(0.1, 0.9, 100))
    half_band_pa = 0.05 * SPAN_PA * (1.0 + 0.3 * np.sin(0.13 * time_s + seed))
    rests_pa = [float(command_pa[0])]
    for u, half in zip(command_pa[:-1], half_band_pa[:-1], strict=True):
        rests_pa.append(min(max(rests_pa[-1], u - half), u + half))
    position_m: Column = 0.1 * np.array(rests_pa) / SPAN_PA + NOISE_M * generator.standard_normal(600)
    return with_noise(Recording({"time_s": time_s, "command_pa": command_pa, "position_m": position_m}), NOISE_M)


def test_friction_that_wanders_is_not_taken_for_a_command_that_goes_on() -> None:
    """What it leaves is alike in all movements of a stroke: taken for so many, they were sure of what is not so."""
    found = [part_of_the_way(ready(wandering(seed))) for seed in range(12)]
    off = [each.part / each.std for each in found if each is not None]
    assert len(off) == 12
    assert np.sqrt(np.mean(np.square(off))) < 2.0
    assert not any(each.between for each in found if each is not None)


def test_a_command_that_stands_still_as_the_stem_moves_was_held() -> None:
    record = ready(once_a_second(SEED))
    assert part_of_the_way(record) is None
    assert sampling(record, SEED.valve).sure


@pytest.mark.parametrize("offset_s", [0.3, 0.5])
def test_a_slow_valve_under_steps_that_fall_between_samples_is_not_taken_for_sure(offset_s: float) -> None:
    """It moves on for many samples under a command that stands still; the few with which it goes on tell."""
    slow = with_effect(CALM, "rate_limit", filling_pa_per_s=1e4, venting_pa_per_s=1e4)
    found = sampling(ready(once_a_second(slow, 400, held_s=5.0, offset_s=offset_s)), CALM.valve)
    assert not (found.held and found.sure)
    steady = sampling(ready(once_a_second(slow, 400, held_s=5.0)), CALM.valve)
    assert (steady.motion, steady.sure) == (Motion.QUASI_STATIC, True)


@pytest.mark.parametrize("acts_s", [1.0, ACTS_S])
def test_a_few_movements_leave_it_open_and_that_is_said(acts_s: float) -> None:
    recording = ramping(CALM, acts_s)
    few = {name: column[:22] for name, column in recording.columns.items()}
    found = sampling(ready(Recording(few, recording.metadata)), CALM.valve)
    assert (found.held, found.sure) == (True, False)


def test_one_swing_again_and_again_says_nothing() -> None:
    """Its few movements are told by eight numbers as well as by any."""
    recording = ramping(CALM, 1.0)
    lap = {name: np.tile(column[:20], 15) for name, column in recording.columns.items()} | {"time_s": np.arange(300.0)}
    part = part_of_the_way(ready(Recording(lap, recording.metadata)))
    assert part is not None
    assert not part.held
    assert not part.between


def test_models_of_one_record_are_judged_by_the_same_landings() -> None:
    """Of friction thrice as high a pressure that still moves shifts less: by its own numbers it had more landings."""
    recording = once_a_second(SEED, 100, offset_s=0.5)
    stirred_pa = recording.command_pa + np.random.default_rng(2).uniform(0.0, 1500.0, 100)
    record = ready(Recording({**recording.columns, "command_pa": stirred_pa}, recording.metadata))
    valves = [ValveFile(valve=each) for each in (SEED.valve, STUCK)]
    by = sampling(record, SEED.valve)
    assert by.motion is Motion.LANDINGS
    own, stuck = (FreeRun(Composition.from_file(each), record).judged for each in valves)
    assert own.sum() < stuck.sum()
    alike = FreeRun(Composition.from_file(valves[1]), record, by=by).judged
    np.testing.assert_array_equal(own, alike)


def test_a_valve_fitted_again_is_judged_by_the_landings_of_the_search() -> None:
    """Where a search begins anew from what it has come to, the rows stay those of the valve that it was given."""
    recording = once_a_second(SEED, 150, offset_s=0.5)
    stirred_pa = recording.command_pa + np.random.default_rng(2).uniform(0.0, 1500.0, 150)
    parts = split([Recording({**recording.columns, "command_pa": stirred_pa}, recording.metadata)])
    search = EffectSearch(parts, {}, SEED, workers=1, progress=lambda _what, _done: None)
    one, other = (search.base(ValveFile(valve=each)) for each in (SEED.valve, STUCK))
    assert one.errors.logs.size == other.errors.logs.size
    assert one.fit.count == other.fit.count


def logged(offset_s: float) -> Record:
    """Steps of the command, so long after a sample of every 20 ms, as a logger reads it and the stem."""
    generator = np.random.default_rng(4)
    fine_s, every, held = 0.005, 4, 400
    late = round(offset_s / fine_s)
    levels_pa = generator.uniform(1e4, 7e4, 16)
    command_pa = np.concatenate([np.full(held + late, levels_pa[0]), np.repeat(levels_pa[1:], held)])
    composition = Composition.from_file(SEED)
    response = respond(composition, composition.theta, command_pa[:-1], fine_s, step_s=fine_s)
    position_m = response.indicated_m + NOISE_M * generator.standard_normal(command_pa.size)
    time_s: Column = np.linspace(0.0, fine_s * (command_pa.size - 1), command_pa.size)
    return ready(
        Recording({"time_s": time_s[::every], "command_pa": command_pa[::every], "position_m": position_m[::every]})
    )


def test_a_logger_between_whose_samples_commands_change_knows_them_to_a_sample() -> None:
    seen = sampling(logged(0.01), SEED.valve)
    assert seen.motion is Motion.DYNAMIC
    assert not seen.sure
    assert "movements had begun by the sample in which it is first recorded" in seen.sentence
    held = sampling(logged(0.0), SEED.valve)
    assert (held.motion, held.sure, held.sentence) == (Motion.DYNAMIC, True, "")

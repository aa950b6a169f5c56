"""A valve seen once a second: simulated without inertia, and landing by landing where commands change in between."""

import numpy as np
import pytest

from config.errors import InputError
from config.recording import Recording
from signals.moves import rests
from sim.composition import Composition
from tests.workbench.slow_records import SPAN_PA, once_a_second
from tests.workbench.valves import NOISE_M, SEED, with_effect
from workbench.data.informative_rows import eventful
from workbench.data.noise_floor import with_noise
from workbench.data.record import ready
from workbench.fit.fitting import fit
from workbench.model.free_run import FreeRun
from workbench.model.simulation_regime import DYNAMIC, Motion, landings, sampling

ASYMMETRIC = with_effect(SEED, "asymmetric_friction", asymmetry=0.15)


def test_a_held_command_seen_once_a_second_gives_the_asymmetry() -> None:
    recording = once_a_second(ASYMMETRIC)
    assert sampling(ready(recording), SEED.valve).motion is Motion.QUASI_STATIC
    base = fit(recording, SEED, workers=1)
    found = fit(recording, SEED, effects=["asymmetric_friction"], base=base, workers=1)
    assert "viscous_ns_per_m" not in found.parameters
    assert found.parameters["asymmetric_friction.asymmetry"].value == pytest.approx(0.15, abs=0.005)
    assert found.parameters["spring_n_per_m"].value == pytest.approx(SEED.valve.spring_n_per_m, rel=2e-3)
    assert found.rms_m < 1.15 * NOISE_M < 5.0 * NOISE_M < base.rms_m
    assert "without inertia" in found.summary()


def test_a_command_that_changed_between_samples_is_judged_by_landings() -> None:
    recording = once_a_second(ASYMMETRIC, offset_s=0.5)
    found = sampling(ready(recording), SEED.valve)
    assert found.motion is Motion.LANDINGS
    assert not found.held
    assert "landings" in found.sentence
    base = fit(recording, SEED, workers=1)
    extended = fit(recording, SEED, effects=["asymmetric_friction"], base=base, workers=1)
    assert set(base.parameters) == {"spring_n_per_m", "coulomb_n"}
    assert extended.parameters["asymmetric_friction.asymmetry"].value == pytest.approx(0.15, abs=0.005)
    assert extended.rms_m < 1.15 * NOISE_M


@pytest.mark.parametrize(("offset_s", "name"), [(0.0, "quadratic_drag"), (0.5, "quadratic_drag"), (0.5, "ip_lag")])
def test_an_effect_that_cannot_show_is_refused_by_name(offset_s: float, name: str) -> None:
    recording = once_a_second(SEED, 100, offset_s=offset_s)
    base = fit(recording, SEED, workers=1)
    with pytest.raises(InputError, match=f"{name} cannot be fitted: it acts"):
        fit(recording, SEED, effects=[name], base=base, workers=1)


def test_both_ways_to_simulate_say_the_same_where_both_apply() -> None:
    recording = once_a_second(SEED, 100)
    record, composition = ready(recording), Composition.from_file(SEED)
    slow, dynamic = (FreeRun(composition, record, by=by).run(composition.theta) for by in (None, DYNAMIC))
    assert float(np.std(slow.indicated_m - dynamic.indicated_m)) < 0.2 * NOISE_M


def test_rows_that_say_it_again_are_passed_over_and_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    recording = once_a_second(with_effect(SEED, "ip_lag", time_constant_s=3.0), 400, held_s=100.0)
    record, composition = ready(recording), Composition.from_file(SEED)
    kept = eventful(record, record.command_pa, 0, 400)
    assert kept.sum() < 120
    run = FreeRun(composition, record)
    np.testing.assert_array_equal(run.judged, kept)
    passed_over = run.run(composition.theta).indicated_m
    monkeypatch.setattr("workbench.model.slow_segments.eventful", lambda *_: np.ones(400, np.bool_))
    whole = FreeRun(composition, record).position_m(composition.theta)
    np.testing.assert_allclose(passed_over, whole, rtol=0.0, atol=1e-12)


def test_fast_sampling_is_simulated_with_inertia() -> None:
    recording = once_a_second(SEED, 100)
    fast = Recording({**recording.columns, "time_s": 0.01 * recording.time_s})
    assert sampling(ready(with_noise(fast, NOISE_M)), SEED.valve).motion is Motion.DYNAMIC


def test_a_rest_knows_where_its_slide_came_from() -> None:
    x = np.repeat([1.0, 2.0, 1.5, 1.6, 1.5], [4, 3, 3, 1, 5])
    assert [(each.first, each.end, each.direction) for each in rests(x, 1e-3)] == [
        (0, 4, 0), (4, 7, 1), (7, 10, -1), (11, 16, -1)
    ]  # fmt: skip
    assert not rests(np.linspace(0.0, 1.0, 300), 1e-3), "it creeps"
    cut = np.array([0.0, 1e-3, 0.0, -3e-3, 3e-3, 0.0, 1e-3, 0.0])
    assert [each[:2] for each in rests(cut, 1e-3)] == [(0, 8)], "two samples of noise make no slide"
    stray = np.repeat([0.0, 1e-3, -4.5e-3, 1e-3, 0.0], [5, 1, 1, 1, 5])
    assert [each[:2] for each in rests(stray, 1e-3)] == [(0, 13)], "nor does one that is far from both beside it"
    early = np.repeat([1.0, 0.0, 4e-3, -2e-3, 0.0], [4, 1, 1, 1, 5])
    assert [(each.first, each.direction) for each in rests(early, 1e-3)] == [(0, 0), (4, -1)], "nor soon after one"
    short = np.repeat([0.0, 1e-2], [1000, 12])
    assert [each[:2] for each in rests(short, 1e-3)] == [(0, 1000), (1000, 1012)], "one of its own beside a long one"


def test_a_landing_under_a_moving_pressure_is_not_settled() -> None:
    recording = once_a_second(SEED, 100, offset_s=0.5)
    whole = landings(ready(recording), SEED.valve)
    assert all(each.settled for each in whole)
    moving = recording.command_pa + 0.2 * SPAN_PA * (np.arange(100) % 2)
    unsettled = landings(ready(Recording({**recording.columns, "command_pa": moving})), SEED.valve)
    assert not any(each.settled for each in unsettled)

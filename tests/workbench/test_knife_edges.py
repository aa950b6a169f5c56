"""A held-out slip that is narrowly mistimed is excepted by name; what no change of friction puts right is not."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import ValveFile
from sim.composition import Composition
from tests.workbench.valves import NOISE_M, drawn_valve, record_of, with_effect
from workbench.data.held_out import Part, residual_m
from workbench.data.record import ready
from workbench.model.free_run import FreeRun
from workbench.select.block_errors import BlockErrors, knife_edges_sentence
from workbench.select.knife_edges import KnifeEdge, error_without, knife_edges, rms

TRUE = drawn_valve(np.random.default_rng(19))


def whole(recording: Recording) -> Part:
    record = ready(recording)
    return Part(recording, record, record.valid)


@pytest.fixture(scope="module")
def part() -> Part:
    return whole(record_of(TRUE, 19))


def rms_without(time_s: Column, error_m: Column, edges: tuple[KnifeEdge, ...]) -> float:
    return rms(error_without(time_s, error_m, edges))


def error_of(valve: ValveFile, part: Part) -> Column:
    composition = Composition.from_file(valve)
    return residual_m(part, FreeRun(composition, part.record).position_m(composition.theta))


def changed(**factors: float) -> ValveFile:
    base = TRUE.valve
    update = {name: factor * getattr(base, name) for name, factor in factors.items()}
    return TRUE.model_copy(update={"valve": base.model_copy(update=update)})


def found(valve: ValveFile, part: Part) -> tuple[tuple[KnifeEdge, ...], float]:
    error_m = error_of(valve, part)
    edges = knife_edges(valve, part, part, error_m, NOISE_M, from_pressure=False)
    return edges, rms_without(part.record.time_s, error_m, edges)


def test_a_slip_that_is_narrowly_mistimed_is_told_with_what_puts_it_right(part: Part) -> None:
    mistimed = changed(static_n=0.998)
    assert np.nanstd(error_of(mistimed, part)) > 10.0 * NOISE_M
    edges, rest_m = found(mistimed, part)
    assert edges
    assert {(each.parameter, each.change > 0.0) for each in edges} == {("static_n", True)}
    assert "is narrowly mistimed from" in edges[0].sentence
    assert "% higher puts it right" in edges[0].sentence
    assert rest_m < 1.1 * NOISE_M


def test_the_truth_has_none(part: Part) -> None:
    assert found(TRUE, part)[0] == ()


def test_a_wrong_spring_is_no_knife_edge(part: Part) -> None:
    edges, rest_m = found(changed(spring_n_per_m=1.03), part)
    assert rest_m > 5.0 * NOISE_M
    assert len(edges) <= 2


def test_a_stop_that_is_not_there_is_no_knife_edge(part: Part) -> None:
    """What the issue saw: a stop invented where the fitted record ended, held out at 7 mm."""
    lowest_m, highest_m = float(part.record.position_m.min()), float(part.record.position_m.max())
    contact = {"stiffness_n_per_m": 1e7, "damping_ns_per_m": 1e3}
    stopped = with_effect(TRUE, "end_stop", lower_m=lowest_m + 5e-3, travel_m=highest_m - lowest_m, **contact)
    _, rest_m = found(stopped, part)
    assert rest_m > 5.0 * NOISE_M


def test_many_mistimed_slips_are_the_models_fault(part: Part) -> None:
    assert found(changed(static_n=0.995, coulomb_n=1.01), part)[0] == ()


def test_another_friction_than_was_fitted_is_no_knife_edge(part: Part) -> None:
    """One change puts every slip right, but what was fitted tells that friction better."""
    other = changed(static_n=1.0 / 1.01)
    both = partial(knife_edges, other, part=part, error_m=error_of(other, part), floor_m=NOISE_M, from_pressure=False)
    assert both(fitted=whole(record_of(other, 20))) == ()
    assert len(both(fitted=part)) > 3, "where what was fitted allows the change, all of them are"


@pytest.mark.parametrize(("percent", "samples"), [(5, 400), (30, 200)])
def test_few_slips_leave_static_friction_a_wide_interval(part: Part, percent: int, samples: int) -> None:
    """Of a few seconds fitted so much more static friction makes the same slips: what was held out asks for less."""
    higher = changed(static_n=1.0 / (1.0 - percent / 100))
    error_m = error_of(higher, part)
    edges = knife_edges(higher, whole(record_of(TRUE, 23, samples)), part, error_m, NOISE_M, from_pressure=False)
    assert {(each.parameter, each.change) for each in edges} == {("static_n", -percent / 100)}
    assert f"static friction {percent} % lower, allowed by what was fitted, puts it right" in edges[0].sentence
    assert rms_without(part.record.time_s, error_m, edges) < 1.1 * NOISE_M
    assert knife_edges(higher, whole(record_of(higher, 20)), part, error_m, NOISE_M, from_pressure=False) == ()


def test_a_lone_sample_far_off_does_not_hide_that_one_change_puts_all_slips_right(part: Part) -> None:
    higher = changed(static_n=1.0 / 0.95)
    recording = record_of(TRUE, 19)
    at_rest = int(np.argmin(np.abs(error_of(higher, part))))
    position_m = recording.columns["position_m"].copy()
    position_m[at_rest] += 7.0 * NOISE_M
    spiked = whole(replace(recording, columns={**recording.columns, "position_m": position_m}))
    error_m = error_of(higher, spiked)
    edges = knife_edges(higher, whole(record_of(TRUE, 23, 400)), spiked, error_m, NOISE_M, from_pressure=False)
    assert {(each.parameter, each.change) for each in edges} == {("static_n", -0.05)}
    spike_s = spiked.record.time_s[at_rest]
    assert not any(each.from_s <= spike_s <= each.to_s for each in edges), "no friction puts it right"


def test_a_stretch_of_many_slips_is_no_knife_edge(part: Part) -> None:
    other = changed(coulomb_n=1.0 / 1.02)
    assert np.nanstd(error_of(other, part)) > 3.0 * NOISE_M
    error_m = error_of(other, part)
    assert knife_edges(other, whole(record_of(other, 20)), part, error_m, NOISE_M, from_pressure=False) == ()


def test_the_rms_without_leaves_out_the_stretches_and_nothing_else() -> None:
    time_s: Column = np.arange(10.0)
    error_m: Column = np.where((time_s > 3.0) & (time_s < 6.0), 1.0, 0.1)
    edge = KnifeEdge(4.0, 5.0, "static_n", 0.01)
    assert rms_without(time_s, error_m, (edge,)) == pytest.approx(0.1)
    assert rms_without(time_s, error_m, (replace(edge, to_s=4.0),)) > 0.3
    assert rms_without(time_s, error_m, ()) == pytest.approx(np.sqrt(np.mean(error_m**2)))


def test_of_many_exceptions_the_first_three_are_named_and_the_others_counted() -> None:
    """Of a week at 1 s the sentence of 42 had 4 kB."""
    edges = tuple(KnifeEdge(10.0 * i, 10.0 * i + 5.0, "coulomb_n", -0.01) for i in range(42))
    logs = np.zeros(2)
    errors = BlockErrors(1.0, 1.0, 1.0, 1.0, logs, logs, 0.0, 1.0, edges, NOISE_M)
    sentence = knife_edges_sentence(errors, TRUE.valve.own.length)
    assert sentence.count("narrowly mistimed") == 3
    assert "from 20 to 25 s: sliding friction 1 % lower puts it right; and 39 more; without, 0.05 mm rms." in sentence
    assert "more" not in knife_edges_sentence(replace(errors, knife_edges=edges[:3]), TRUE.valve.own.length)

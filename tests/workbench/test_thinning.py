"""A record with fewer rows: the model runs through it as through the whole one, and it begins alike."""

from dataclasses import replace

import numpy as np
import pytest

from config.recording import Recording
from sim.composition import Composition
from sim.open_loop import respond
from tests.workbench.valves import NOISE_M, drawn_valve
from workbench.data.record import Record, ready
from workbench.model.free_run import FreeRun
from workbench.model.thinning import thinned

PERIOD_S = 0.001
VALVE = drawn_valve(np.random.default_rng(3))
COMPOSITION = Composition.from_file(VALVE)
HELD_ROWS = 377
"""Between two steps: no whole number of what is kept."""


def record_of(command_pa: np.ndarray) -> Record:
    """Return what a noisy sensor sees of a valve at 1 kHz."""
    path = respond(COMPOSITION, COMPOSITION.theta, command_pa[:-1], PERIOD_S, position_m=0.05, pressure_pa=4e4)
    noisy_m = path.indicated_m + NOISE_M * np.random.default_rng(1).standard_normal(command_pa.size)
    return ready(Recording({"time_s": path.time_s, "command_pa": command_pa, "position_m": noisy_m}))


def staircase() -> Record:
    return record_of(np.repeat(1e3 * np.array([40, 80, 20, 60, 30, 90, 50, 10]), HELD_ROWS))


def sine() -> Record:
    return record_of(4.5e4 + 3.5e4 * np.sin(2.0 * np.arange(3000) * PERIOD_S * np.pi))


def most_apart_m(whole: Record, fewer: Record) -> float:
    """Return how far a run through fewer rows is from one through all, at most."""
    here, there = (FreeRun(COMPOSITION, each).position_m(COMPOSITION.theta) for each in (whole, fewer))
    return float(np.max(np.abs(here[np.searchsorted(whole.time_s, fewer.time_s)] - there)))


def test_steps_are_where_they_were() -> None:
    whole = staircase()
    fewer = thinned(whole, VALVE.valve)
    assert len(fewer) < 0.2 * len(whole)
    assert most_apart_m(whole, fewer) < 1e-6


def test_what_changes_all_the_time_is_its_mean() -> None:
    whole = sine()
    fewer = thinned(whole, VALVE.valve)
    assert len(fewer) < 0.2 * len(whole)
    assert most_apart_m(whole, fewer) < 10.0 * NOISE_M, "that of a slip: half a row's time early or late"


def test_segments_begin_as_they_did() -> None:
    whole = staircase()
    parted = replace(whole, segments=((30, 1201), (1300, len(whole))), commanded_from=(10, 1290))
    fewer = thinned(parted, VALVE.valve)
    for (first, end), (here, there), begun in zip(parted.segments, fewer.segments, fewer.commanded_from, strict=True):
        assert fewer.time_s[here] == whole.time_s[first]
        assert fewer.time_s[there - 1] == whole.time_s[end - 1]
        assert fewer.time_s[begun] in whole.time_s[[10, 1290]]
        np.testing.assert_array_equal(fewer.position_m[here : here + 50], whole.position_m[first : first + 50])
    assert most_apart_m(whole, thinned(whole, VALVE.valve)) < 1e-6


@pytest.mark.parametrize(
    "record",
    [
        replace(staircase(), by_setpoint=True),
        replace(staircase(), time_s=20.0 * staircase().time_s),
    ],
    ids=["behind a positioner", "sampled slowly"],
)
def test_what_is_seldom_or_no_pressure_stays(record: Record) -> None:
    assert thinned(record, VALVE.valve) is record


def test_a_stem_without_spring_is_compared_at_every_row() -> None:
    drive = VALVE.valve.model_copy(update={"spring_n_per_m": 0.0})
    record = staircase()
    assert thinned(record, drive) is record

"""Of a long recording, the stretches that are fitted."""

from collections.abc import Iterator

import numpy as np
import pytest

from config.recording import Recording
from workbench.data import stretches
from workbench.data.held_out import split
from workbench.data.informative_rows import eventful
from workbench.data.record import SLIP_ROWS, ready
from workbench.data.stretches import STRETCHES, informative

NOISE_M, HELD = 5e-5, 60
FEW, MANY, WORK = 100, 300, 8_000
"""A fifth of what is fitted of a recording, and of its moves: as many stretches, in a fifth of the time."""


@pytest.fixture(autouse=True, scope="module")
def _work() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(stretches, "FITTED_WORK", WORK)
        yield


def steps(count: int, sizes_m: np.ndarray) -> Recording:
    """Record a stem that goes at once where it is sent, every minute, once a second."""
    generator = np.random.default_rng(0)
    at_m = 0.05 + np.resize(sizes_m, count) * (-1.0) ** np.arange(count)
    position_m = np.repeat(at_m, HELD)
    command_pa = 1e6 * position_m
    position_m = position_m + NOISE_M * generator.standard_normal(position_m.size)
    time_s = np.arange(position_m.size, dtype=np.float64)
    return Recording({"time_s": time_s, "command_pa": command_pa, "position_m": position_m}, {"valve": "FV 1"})


def test_what_can_be_fitted_whole_is() -> None:
    recording = steps(FEW, np.array([0.01]))
    assert informative(recording) is recording


@pytest.fixture(scope="module")
def long() -> Recording:
    """Of many moves every twentieth is ten times the others."""
    return steps(MANY, np.where(np.arange(MANY) % 20 == 10, 0.02, 0.002))


@pytest.fixture(scope="module")
def chosen(long: Recording) -> Recording:
    return informative(long)


def test_stretches_are_spread_over_a_long_one_and_cost_what_is_allowed(long: Recording, chosen: Recording) -> None:
    record = ready(chosen)
    assert len(record.segments) == STRETCHES
    starts_s = chosen.time_s[[first for first, _ in record.segments]]
    assert np.all(np.histogram(starts_s, STRETCHES, (0.0, long.time_s[-1]))[0] == 1)
    rows = sum(int(eventful(record, record.command_pa, first, end).sum()) for first, end in record.segments)
    assert 0.8 * WORK < rows + SLIP_ROWS * len(chosen) / HELD <= 1.05 * WORK


def test_they_are_where_the_stem_travels_the_farthest_and_begin_and_end_at_rest(
    long: Recording, chosen: Recording
) -> None:
    far = np.flatnonzero(np.abs(np.diff(long.position_m)) > 0.01)
    assert np.isin(far, chosen.time_s).mean() > 0.7, "time counts the samples"
    for first, end in ready(chosen).segments:
        for rest in (chosen.position_m[first : first + 20], chosen.position_m[end - 20 : end]):
            assert np.ptp(rest) < 8.0 * NOISE_M


def test_what_was_left_out_is_told_once_and_no_gap(long: Recording) -> None:
    notes = split([long]).train.record.notes
    (told,) = [each for each in notes if each.startswith("not fitted: ")]
    assert f" of {MANY * HELD} samples: of {MANY - 1} slips those of {STRETCHES} stretches" in told
    assert not any("simulated anew" in each for each in notes)


def test_nothing_is_taken_where_nothing_moves() -> None:
    moving = steps(MANY, np.array([0.01]))
    still = np.arange(len(moving)) > 3 * len(moving) // 4
    position_m = np.where(still, 0.05, moving.position_m)
    chosen = informative(Recording({**moving.columns, "position_m": position_m}))
    assert chosen.time_s[-1] <= 3 * len(moving) // 4 + HELD

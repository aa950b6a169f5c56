"""A stem that moves before its command says that two clocks differ; one that is late, or in a loop, does not."""

from functools import cache

import numpy as np
import pytest

from config.recording import Column, Recording
from config.valve_file import ValveFile
from tests.workbench.slow_records import SPAN_PA, once_a_second
from tests.workbench.valves import NOISE_M, SEED, with_effect
from workbench.data.clock_difference import Early
from workbench.data.noise_floor import with_noise
from workbench.data.record import ready
from workbench.diagnosis.diagnosis import diagnose
from workbench.discover.discovery import discover


@cache
def steps() -> Recording:
    return once_a_second(SEED, 1500)


def shifted(recording: Recording, samples: int) -> Recording:
    """Return a recording whose command has so many samples later a time than it was given at."""
    late: Column = recording.columns["command_pa"][np.clip(np.arange(len(recording)) - samples, 0, len(recording) - 1)]
    return Recording({**recording.columns, "command_pa": late}, recording.metadata)


@pytest.mark.parametrize(("samples", "least_s", "most_s"), [(2, 0.0, 2.0), (3, 1.0, 3.0)])
def test_a_command_whose_clock_is_late_is_seen_to(samples: int, least_s: float, most_s: float) -> None:
    """A stem that has moved a sample after a held command is seen a sample less before it."""
    found = ready(shifted(steps(), samples)).early
    assert isinstance(found, Early)
    assert (found.least_s, found.most_s) == (least_s, most_s)
    assert found.early == found.turns > 10
    assert found.sentence in ready(shifted(steps(), samples)).notes


@pytest.mark.parametrize("late", [0, -2, -3, -6], ids=lambda late: f"stem {-late} s late")
def test_a_stem_that_is_late_obeys(late: int) -> None:
    """A dead time, or the position's clock: later even than the next change."""
    assert ready(shifted(steps(), late)).early is None


@pytest.mark.parametrize(
    "file",
    [with_effect(SEED, "ip_lag", time_constant_s=3.0), with_effect(SEED, "backlash", width_m=4e-3)],
    ids=["lag", "play"],
)
def test_a_valve_that_lags_or_has_play_obeys(file: ValveFile) -> None:
    assert ready(once_a_second(file, 1500)).early is None


@pytest.mark.parametrize("scan", [3, 5])
def test_a_loop_that_hunts_is_no_clock(scan: int) -> None:
    """Stiction, and a controller of its own scan that answers each slip: the command follows the stem, against it."""
    generator = np.random.default_rng(1)
    command, position, flow, integral = 0.5, 0.5, 0.5, 0.5
    rows = []
    for second in range(1800):
        if second % scan == 0:
            error = 0.5 + 0.1 * (second // 300 % 2) - flow + 1e-3 * generator.standard_normal()
            integral += 0.02 * scan * error
            command = 0.2 * error + integral
        rows.append((command, position))
        if abs(command - position) > 0.04:
            position = command - 0.01 * np.sign(command - position)
        flow += 0.3 * (position - flow)
    u, x = np.array(rows).T
    assert np.count_nonzero(np.diff(np.sign(np.diff(u[::scan])))) > 20
    noise_m = NOISE_M * generator.standard_normal(len(rows))
    columns = {"time_s": np.arange(1800.0), "command_pa": SPAN_PA * u, "position_m": SEED.valve.stroke_m * x + noise_m}
    assert ready(with_noise(Recording(columns), NOISE_M)).early is None


@pytest.mark.parametrize("lag", np.arange(0.1, 2.0 * np.pi, 0.5 * np.pi))
def test_a_loop_faster_than_its_samples_is_no_clock(lag: float) -> None:
    """It goes round in four thirds of a sample, which looks like a stem that leads by a quarter of four samples."""
    rows = np.arange(600.0)
    u = 0.5 + 0.2 * np.sin(2.0 * np.pi * 0.75 * rows - 0.7)
    x = 0.5 + 0.1 * np.sign(np.sin(2.0 * np.pi * 0.75 * rows - 0.7 - lag))
    noise_m = NOISE_M * np.random.default_rng(2).standard_normal(rows.size)
    columns = {"time_s": rows, "command_pa": SPAN_PA * u, "position_m": SEED.valve.stroke_m * x + noise_m}
    assert ready(with_noise(Recording(columns), NOISE_M)).early is None


@pytest.mark.long
def test_of_two_clocks_nothing_is_judged() -> None:
    """It was "unexplained": something is missing that the library does not have."""
    found = diagnose(shifted(steps(), 3), SEED, effects=["dead_time"])
    assert found.verdict == "unjudged"
    assert found.sentence.startswith("Not judged: the stem turns before its command in ")
    assert "turns, by 1 to 3 s: their two clocks differ by that, and by what the stem is late besides" in found.sentence
    assert "Record both by one clock" in found.sentence
    assert not any("two clocks" in str(each) for each in found.blocks()[1:])


@pytest.mark.long
def test_nor_is_a_form_sought() -> None:
    found = discover(shifted(steps(), 3), SEED)
    assert found.outcome == "unjudged"
    assert "two clocks" in found.sentence


def test_a_lead_of_less_than_a_sample_is_said_as_a_limit() -> None:
    assert "by up to 2 s" in Early(0.0, 2.0, 9, 9).sentence
    assert "by 1 to 3 s" in Early(1.0, 3.0, 9, 9).sentence

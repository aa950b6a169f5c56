"""`positioner estimate` on recordings sampled as historians do, of a valve with a preload: right, or refused."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from config.codes import Refusal
from config.recording import Recording
from config.valve_file import valve
from positioner.cli.main import main
from positioner.estimation.recording_estimates import RecordingEstimates, estimate
from tests.cases import few_always
from tests.simulated import simulated

FINEST_S = 0.01
ORDINARY = valve("ordinary")
AREA_M2, STROKE_M = ORDINARY.valve.diaphragm_area_m2, ORDINARY.valve.stroke_m
TRUE_PA_PER_M = -ORDINARY.valve.spring_n_per_m / AREA_M2
LOW_PA, SPAN_PA = 1400.0 / AREA_M2, ORDINARY.valve.spring_n_per_m * STROKE_M / AREA_M2


@cache
def moved(kind: str, held: int) -> Recording:
    """Return a recording at 10 ms; random pressures are held for so many samples."""
    time_s = np.arange(0.0, 120.0, FINEST_S)
    rng = np.random.default_rng(4)
    share = {
        "sine": 0.5 - 0.4 * np.cos(2 * np.pi * time_s / 20.0),
        "triangle": 0.1 + 0.8 * np.abs((time_s / 20.0) % 2 - 1),
        "random": np.repeat(rng.uniform(0.1, 0.9, time_s.size), held)[: time_s.size],
    }[kind]
    return simulated(ORDINARY, time_s, LOW_PA + SPAN_PA * share, noise_std_m=2e-4 * STROKE_M)


def driven(kind: str, period_s: float) -> RecordingEstimates:
    every = round(period_s / FINEST_S)
    whole = moved(kind, 3 * every if kind == "random" else 1)
    columns = ("time_s", "command_pa", "position_m")
    return estimate(Recording({name: whole.columns[name][::every] for name in columns}))


@pytest.mark.parametrize("period_s", few_always([0.05, 1.0, 0.01, 0.2], 2))
@pytest.mark.parametrize("kind", ["sine", "triangle", "random"])
def test_a_slope_is_right_or_refused(kind: str, period_s: float) -> None:
    found = driven(kind, period_s).estimates.b_over_c
    assert not found.valid or abs(found.value / TRUE_PA_PER_M - 1.0) < 0.05


def test_what_a_preload_would_explain_as_well_says_so() -> None:
    found = driven("sine", 0.05)
    assert abs(found.estimates.b_over_c.value / TRUE_PA_PER_M - 1.0) > 0.4
    assert found.estimates.b_over_c.reason is Refusal.PRELOAD_EXPLAINS_AS_WELL
    assert not found.law_ready


def test_commands_in_bar_are_asked_about(tmp_path: Path) -> None:
    rows = moved("sine", 1)
    columns = {"time_s": rows.time_s, "command_pa": 1e-5 * rows.command_pa, "position_m": rows.position_m}
    in_bar = Recording({name: column[:1000] for name, column in columns.items()})
    in_bar.write(tmp_path / "bar.csv")
    main(["estimate", str(tmp_path / "bar.csv"), "--json", str(tmp_path / "said.json")])
    (note,) = json.loads((tmp_path / "said.json").read_text())["notes"]
    assert "are they in bar, kPa or %?" in note

"""`positioner estimate` on recordings sampled as historians do, of a valve with a preload: right, or refused."""

import numpy as np
import pytest

from config.codes import Refusal
from config.recording import Recording
from config.valve_file import valve
from positioner.estimation.recording_estimates import RecordingEstimates, estimate
from sim.simulation import simulate

ORDINARY = valve("ordinary")
AREA_M2, STROKE_M = ORDINARY.valve.diaphragm_area_m2, ORDINARY.valve.stroke_m
TRUE_PA_PER_M = -ORDINARY.valve.spring_n_per_m / AREA_M2
LOW_PA, SPAN_PA = 1400.0 / AREA_M2, ORDINARY.valve.spring_n_per_m * STROKE_M / AREA_M2


def driven(kind: str, period_s: float) -> RecordingEstimates:
    dt_s = 0.01
    time_s = np.arange(0.0, 120.0, dt_s)
    every = round(period_s / dt_s)
    rng = np.random.default_rng(4)
    share = {
        "sine": 0.5 - 0.4 * np.cos(2 * np.pi * time_s / 20.0),
        "triangle": 0.1 + 0.8 * np.abs((time_s / 20.0) % 2 - 1),
        "random": np.repeat(rng.uniform(0.1, 0.9, time_s.size), 3 * every)[: time_s.size],
    }[kind]
    whole = simulate(ORDINARY, time_s, LOW_PA + SPAN_PA * share, noise_std_m=2e-4 * STROKE_M)
    columns = ("time_s", "command_pa", "position_m")
    return estimate(Recording({name: whole.columns[name][::every] for name in columns}))


@pytest.mark.parametrize("period_s", [0.01, 0.05, 0.2, 1.0])
@pytest.mark.parametrize("kind", ["sine", "triangle", "random"])
def test_a_slope_is_right_or_refused(kind: str, period_s: float) -> None:
    found = driven(kind, period_s).estimates.b_over_c
    assert not found.valid or abs(found.value / TRUE_PA_PER_M - 1.0) < 0.05


def test_what_a_preload_would_explain_as_well_says_so() -> None:
    found = driven("sine", 0.05)
    assert abs(found.estimates.b_over_c.value / TRUE_PA_PER_M - 1.0) > 0.4
    assert found.estimates.b_over_c.reason is Refusal.PRELOAD_EXPLAINS_AS_WELL
    assert not found.law_ready

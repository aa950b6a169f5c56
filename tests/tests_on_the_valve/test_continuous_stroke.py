"""The continuous stroke test: break-away friction with an interval that holds the truth, and hardly a move."""

import pytest

from config.codes import ValveTestVerdict
from config.errors import InputError
from config.slave_file import Initial
from positioner.control.settings import Settings
from positioner.tests_on_the_valve.continuous_stroke import ContinuousStroke, continuous_stroke, programme
from positioner.tests_on_the_valve.outcome import Outcome
from tests.tests_on_the_valve.virtual_valve import AREA_M2, SLOPE, STROKE_M, VirtualValve, daemon_file, told

TIGHT = told(coulomb_n=400.0, static_n=440.0)
ASKED = ContinuousStroke(rate=5e-3)


def outcome_of(valve: VirtualValve, slope_pa_per_m: float | None = SLOPE, asked: ContinuousStroke = ASKED) -> Outcome:
    bounds = Settings.of(valve.file).experiment
    start_pa = valve.command_pa()
    played = [valve.play(programme(asked, bounds, start_pa, STROKE_M, way)) for way in (1, -1)]
    return continuous_stroke(played, asked, "FV-1", STROKE_M, slope_pa_per_m)


@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_the_interval_holds_the_break_away_friction(noise: float) -> None:
    valve = VirtualValve(TIGHT, noise=noise)
    begun_m = valve.device.stem_m
    outcome = outcome_of(valve)
    assert outcome.verdicts == (ValveTestVerdict.PASSED,), outcome.summary()
    least, most = (outcome.figure(f"breakaway_{each}_pa") for each in ("least", "most"))
    assert least.value is not None
    assert most.value is not None
    true_pa = 440.0 / AREA_M2
    assert least.value - (least.plus_minus or 0.0) <= true_pa <= most.value + (most.plus_minus or 0.0)
    assert outcome.figure("breakaway_pa").value == pytest.approx(true_pa, rel=0.05)
    assert abs(valve.device.stem_m - begun_m) < 0.02 * STROKE_M


def test_without_a_spring_rate_there_is_no_friction_and_why() -> None:
    outcome = outcome_of(VirtualValve(TIGHT), None)
    assert outcome.figure("breaks_up_pa").value is not None
    assert "the spring rate is not known" in (outcome.figure("breakaway_pa").reason or "")


def test_a_stem_that_does_not_move_within_the_time_is_told() -> None:
    outcome = outcome_of(VirtualValve(TIGHT, daemon_file(experiment={"limit_s": 8.0})))
    assert outcome.verdicts == (ValveTestVerdict.NOT_MOVED,)
    assert "did not move up and down as far as the time limit let the command go" in outcome.notes[0]


def test_at_the_least_command_it_cannot_go_down_and_says_so() -> None:
    outcome = outcome_of(VirtualValve(TIGHT, initial=Initial()))
    assert outcome.verdicts == (ValveTestVerdict.NOT_MOVED,)
    assert "did not move down" in outcome.notes[0]


def test_a_slip_beyond_what_operation_allows_is_told() -> None:
    outcome = outcome_of(VirtualValve(told(coulomb_n=200.0, static_n=700.0)))
    assert ValveTestVerdict.TRAVEL_EXCEEDED in outcome.verdicts


def test_a_rate_at_which_the_time_is_too_short_is_refused_before_anything_moves() -> None:
    bounds = Settings.of(daemon_file(experiment={"limit_s": 60.0})).experiment
    with pytest.raises(InputError, match=r"--rate: at 0\.0005 the command goes 1750 Pa .* allowed is 0\.0036 or more"):
        programme(ContinuousStroke(), bounds, 60e3, STROKE_M, 1, 880.0 / AREA_M2)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(InputError, match=r"--start: allowed is 0\.0001 to 0\.01, got 0\.5"):
        ContinuousStroke(start=0.5).require_possible()

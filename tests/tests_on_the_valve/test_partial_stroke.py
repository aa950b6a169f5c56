"""The partial stroke test on the simulated valve in virtual time: verdicts as codes, its band, what is after it."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.codes import ExperimentState, ValveTestVerdict
from config.errors import InputError
from config.recording import Recording
from config.slave_file import Change, DeviceFault, Initial
from positioner.control.settings import Settings
from positioner.response.figure import Figure
from positioner.tests_on_the_valve.credit import Credit
from positioner.tests_on_the_valve.kept_records import changes, keep, records, trend
from positioner.tests_on_the_valve.outcome import Outcome
from positioner.tests_on_the_valve.partial_stroke import TEST, PartialStroke, partial_stroke, programme
from positioner.tests_on_the_valve.program import Played, Program
from tests.tests_on_the_valve.virtual_valve import (
    AREA_M2,
    MIDWAY,
    PERIOD_S,
    SLOPE,
    STROKE_M,
    VirtualValve,
    daemon_file,
    told,
    vetoed,
)

V = ValveTestVerdict
ASKED = PartialStroke()
ON_THE_SEAT, WIDE_OPEN = Initial(), Initial(position_m=STROKE_M, pressure_pa=130e3)
TIGHT = told(coulomb_n=400.0, static_n=440.0)
STUCK = told(coulomb_n=9e3, static_n=9.5e3)
NO_AIR = DeviceFault(kind="supply", at_s=0.0, to_pa=15e3)
SLACK = told(coulomb_n=60.0, static_n=66.0)


def program_for(valve: VirtualValve, asked: PartialStroke) -> Program:
    bounds = Settings.of(valve.file).experiment
    return programme(asked, bounds, valve.command_pa(), valve.device.stem_m, STROKE_M)


def outcome_of(valve: VirtualValve, asked: PartialStroke = ASKED, reference: Outcome | None = None) -> Outcome:
    return partial_stroke(valve.play(program_for(valve, asked)), asked, "FV-1", STROKE_M, reference)


@pytest.fixture(scope="module")
def reference() -> Outcome:
    return outcome_of(VirtualValve(TIGHT, initial=WIDE_OPEN))


@pytest.mark.parametrize("noise", [0.0, 0.003, 0.01])
@pytest.mark.parametrize("friction_n", [60.0, 100.0, 150.0])
def test_friction_is_of_the_part_that_both_ways_went(friction_n: float, noise: float) -> None:
    """Midway the stem stays by its friction short of where it was: commands of other places are not compared."""
    file = told(coulomb_n=0.99 * friction_n, static_n=1.01 * friction_n)
    friction = outcome_of(VirtualValve(file, initial=MIDWAY, noise=noise)).figure("friction_at_rate_pa")
    late_pa = 140e3 / 60.0 * PERIOD_S  # a position is shown with the command that acts from then on
    assert friction.value == pytest.approx(friction_n / AREA_M2 + late_pa, abs=1.5 * (friction.plus_minus or 0.0))
    assert friction.plus_minus == pytest.approx(0.0, abs=0.1 * friction_n / AREA_M2 + 1.5 * noise * STROKE_M * SLOPE)


@pytest.mark.parametrize(
    ("initial", "noise"), [(ON_THE_SEAT, 0.001), (MIDWAY, 0.0), (WIDE_OPEN, 0.0)], ids=["seat, noisy", "midway", "open"]
)
def test_a_sound_valve_passes_and_is_back(initial: Initial, noise: float) -> None:
    valve = VirtualValve(TIGHT, initial=initial, noise=noise)
    held_pa = valve.command_pa()
    outcome = outcome_of(valve)
    assert outcome.verdicts == (V.PASSED,), outcome.summary()
    travel = outcome.figure("reached_m")
    assert travel.value == pytest.approx(0.1 * STROKE_M, rel=0.15)
    assert valve.command_pa() == held_pa
    friction = outcome.figure("friction_at_rate_pa")
    if initial is MIDWAY:
        assert friction.value is None, "twice the friction takes more than the travel: it does not come back by itself"
        assert any("friction holds it" in each for each in outcome.notes)
        return
    slow_pa_per_s = 140e3 / 60.0
    assert friction.value == pytest.approx(420.0 / AREA_M2, abs=(friction.plus_minus or 0.0) + slow_pa_per_s * PERIOD_S)


def test_break_out_from_the_upper_stop_is_what_the_spring_and_the_packing_say() -> None:
    """From 130 kPa down: what presses onto the stop, then the start tolerance, less the friction that holds."""
    outcome = outcome_of(VirtualValve(TIGHT, initial=WIDE_OPEN))
    balance_pa = (1400.0 - 0.88 * 440.0) / AREA_M2 + SLOPE * STROKE_M
    expected = 130e3 - balance_pa
    figure = outcome.figure("breakout_pa")
    assert figure.value is not None
    assert figure.value == pytest.approx(expected, abs=0.005 * STROKE_M * SLOPE + (figure.plus_minus or 0.0))


CASES: list[tuple[str, Callable[[], Outcome], tuple[ValveTestVerdict, ...]]] = [
    ("stuck", lambda: outcome_of(VirtualValve(STUCK)), (V.NOT_MOVED,)),
    ("no supply", lambda: outcome_of(VirtualValve(STUCK, faults=(NO_AIR,))), (V.NO_SUPPLY,)),
    (
        "threshold",
        lambda: outcome_of(VirtualValve(TIGHT), PartialStroke(threshold_pa=54e3, opening=False)),
        (V.PRESSURE_THRESHOLD, V.TRAVEL_NOT_REACHED),
    ),
    (
        "jumps beyond the band",
        lambda: outcome_of(VirtualValve(told(coulomb_n=200.0, static_n=2400.0), initial=MIDWAY)),
        (V.TRAVEL_EXCEEDED,),
    ),
    (
        "not back on its seat",
        lambda: outcome_of(
            VirtualValve(TIGHT, changes=(Change(at_s=17.0, coulomb_n=1700.0, static_n=1750.0),), initial=ON_THE_SEAT),
            PartialStroke(travel=0.05, least=0.04),
        ),
        (V.NOT_SEATED,),
    ),
]


@pytest.mark.parametrize(("run", "verdicts"), [each[1:] for each in CASES], ids=[each[0] for each in CASES])
def test_what_is_wrong_is_said_in_a_code(run: Callable[[], Outcome], verdicts: tuple[ValveTestVerdict, ...]) -> None:
    assert run().verdicts == verdicts


def test_against_a_reference_friction_is_high_low_or_as_it_was(reference: Outcome) -> None:
    for file, verdict in (
        (TIGHT, V.PASSED),
        (told(coulomb_n=800.0, static_n=880.0), V.FRICTION_HIGH),
        (SLACK, V.FRICTION_LOW),
    ):
        assert outcome_of(VirtualValve(file, initial=WIDE_OPEN), reference=reference).verdicts == (verdict,)


def test_a_stem_that_comes_back_beyond_where_it_was_has_broken_loose_on_its_way_out() -> None:
    """Down by a tenth, and back above its rest: the break-out is the first motion, not the first one upwards."""
    time_s = np.arange(0.0, 20.0, PERIOD_S)
    command_pa = 60e3 - np.interp(time_s, [0.0, 2.0, 8.0, 14.0], [0.0, 0.0, 12e3, 0.0])
    stem_m = 0.02 + np.interp(time_s, [0.0, 3.0, 8.0, 10.0, 14.0], [0.0, 0.0, -4.4e-3, -4.4e-3, 4e-4])
    recording = Recording({"time_s": time_s, "command_pa": command_pa, "position_m": stem_m})
    outcome = partial_stroke(Played(recording, ExperimentState.TURNED), ASKED, "FV-1", STROKE_M)
    assert outcome.figure("breakout_s").value == pytest.approx(1.2, abs=0.4)
    assert outcome.figure("stroke_s").value == pytest.approx(4.3, abs=0.3)


def test_a_stem_that_creeps_before_the_test_is_told() -> None:
    drift = DeviceFault(kind="drift", at_s=0.0, over_s=60.0, by_m=0.5 * STROKE_M)
    assert V.DEVIATION in outcome_of(VirtualValve(TIGHT, faults=(drift,), initial=MIDWAY)).verdicts


def test_a_veto_breaks_it_off_and_the_command_before_comes_back() -> None:
    valve = VirtualValve(TIGHT, initial=WIDE_OPEN)
    held_pa, turn, count = valve.command_pa(), valve.turn, 0

    def vetoing() -> None:
        nonlocal count
        turn()
        count += 1
        if count == 300:
            assert valve.cycle.snapshot.decision.experiment.commands
            vetoed(valve.cycle)

    valve.turn = vetoing
    played = valve.play(program_for(valve, PartialStroke()))
    outcome = partial_stroke(played, PartialStroke(), "FV-1", STROKE_M)
    assert outcome.verdicts == (V.BROKEN_OFF,)
    assert outcome.notes[0] == "broken off: vetoed"
    assert valve.command_pa() == held_pa


@pytest.mark.parametrize("fast", [False, True], ids=["ramp", "step"])
def test_the_travel_is_kept_within_band_and_speed(fast: bool) -> None:
    """Beyond the turn the stem goes by what passes in the samples that are counted: the margin that is declared."""
    file = daemon_file(experiment={"rate_limit_pa_per_s": 20e3})
    valve = VirtualValve(TIGHT, file, initial=MIDWAY)
    asked = PartialStroke(fast=fast)
    farthest_m, turn, begun_m = 0.0, valve.turn, valve.device.stem_m

    def watched() -> None:
        nonlocal farthest_m
        turn()
        farthest_m = max(farthest_m, abs(valve.device.stem_m - begun_m))

    valve.turn = watched
    outcome = outcome_of(valve, asked)
    assert outcome.verdicts == (V.PASSED,)
    speed = (20e3 if fast else 140e3 / 60.0) / SLOPE
    assert farthest_m <= 0.1 * STROKE_M + 4.0 * PERIOD_S * speed + 2.0 * 40.0 / 140e3


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (PartialStroke(travel=0.9), "--travel: allowed is 0.01 to 0.5 of the stroke, got 0.9"),
        (PartialStroke(least=0.2), "--least: allowed is 0 to 0.1"),
        (PartialStroke(threshold_pa=130e3, opening=False), "--threshold-pa: allowed is beyond the command in force"),
    ],
)
def test_what_cannot_be_is_refused(asked: PartialStroke, said: str) -> None:
    with pytest.raises(InputError) as refused:
        program_for(VirtualValve(), asked)
    assert said in str(refused.value)


def test_without_a_recording_it_says_why() -> None:
    outcome = partial_stroke(
        Played(None, ExperimentState.NO_CONSENT, "no consent of the DCS"), PartialStroke(), "x", 1.0
    )
    assert (outcome.verdicts, outcome.notes) == ((V.BROKEN_OFF,), ("no consent of the DCS",))


def test_records_make_a_trend(reference: Outcome, tmp_path: Path) -> None:
    keep(tmp_path, reference, "as_left", 1e9, {})
    broken = replace(reference, quantities=(), verdicts=(V.BROKEN_OFF,))
    keep(tmp_path, broken, "", 2e9, {})
    shown = trend(records(tmp_path, TEST), ("breakout_pa", "reached_m"))
    assert [row[1] for row in shown.rows] == ["passed", "broken off"]
    assert shown.rows[1][3:5] == ("-", "-")
    json.dumps([list(row) for row in shown.rows])


def test_where_it_began_is_no_change(reference: Outcome) -> None:
    """How far it is to break-out is told by which way the stem had come, not by the packing."""
    quantities = tuple(
        replace(each, figure=Figure(0.1 * (each.figure.value or 0.0), each.figure.plus_minus))
        for each in reference.quantities
    )
    told = {each.quantity.name for each in changes(replace(reference, quantities=quantities), reference)}
    assert "friction_at_rate_pa" in told
    assert not told & {"breakout_pa", "breakout_s", "back_m", "start_m", "command_pa"}


def test_the_credit_by_hand() -> None:
    credit = Credit(1e-6, 0.6, 0.9, 0.1, 5.0, 20.0)
    per_year = 1e-6 * 8766.0 / 2.0
    assert credit.pfd_avg(tested=True) == pytest.approx(per_year * (0.06 + 1.5 + 2.0))
    assert credit.pfd_avg(tested=False) == pytest.approx(per_year * (4.5 + 2.0))
    with pytest.raises(InputError, match="--partial-coverage"):
        replace(credit, partial_share=0.95).require_possible()

"""What permits a commanded test: each row of the table, for S3 and for an experiment, to begin with and under way."""

from collections.abc import Callable
from dataclasses import replace

import pytest

from config.codes import ExperimentState, Fault, InhibitReason, Mode, Quality, State
from config.quantities import DeviceStatus
from positioner.control.controller_memory import Decision
from positioner.control.permissives import (
    ASKED,
    AUTOMATIC,
    CONSENT,
    MEASURED,
    NO_FAULT,
    NO_VETO,
    PERMISSIVES,
    PRESSURES,
    TIME,
    TRAVEL_WINDOW,
    Permissive,
)
from positioner.control.requests import QUIET, ExperimentRequest
from tests.control.test_controller import Bench, automatic

POINTS = ((0.0, 50e3), (5.0, 50e3))
REFERENCE_M = 0.05
BACK_PA = 20e3
"""The balance by which a stem comes back that something else has moved beyond its reference."""
EXCITING = {"eta": (0, 0, 0), "alpha_pa": 50e3}


def permitted(kind: str) -> Bench:
    """Return a bench whose law has moved up to a reference, everything permitted, the test not yet asked for."""
    excitation = {
        "limit_s": 1.0,
        "consent": True,
        "permitted_travel": (0.1, 0.9),
        "kind": kind if kind != "experiment" else "sine",
    }
    bench = automatic(
        excitation=excitation,
        experiment={"travel_window": (0.1, 0.9), "limit_s": 10.0},
        # A stem that a test holds fast shows the same digit, as a frozen sensor does.
        supervision={"frozen_sensor": {"threshold": 0.0}},
    )
    bench.ask(reference_m=REFERENCE_M, experiment=ExperimentRequest(points=POINTS, consented=True))
    bench.step()
    return bench


def ask(bench: Bench, kind: str) -> None:
    if kind == "experiment":
        request = bench.requests.experiment
        bench.ask(experiment=replace(request, starts=request.starts + 1))
    else:
        bench.ask(**EXCITING)


def consents(bench: Bench, *, consented: bool = True, vetoed: bool = False) -> None:
    bench.ask(experiment=replace(bench.requests.experiment, consented=consented, vetoed=vetoed))


def leave(bench: Bench) -> None:
    bench.position_m = 0.095


def overshoot(bench: Bench) -> None:
    points = ((0.0, 50e3), (5.0, 430e3))
    bench.ask(alpha_pa=415e3, experiment=replace(bench.requests.experiment, points=points))


def ask_otherwise(bench: Bench, kind: str) -> None:
    bench.ask(eta=(0, 0, 0) if kind == "experiment" else QUIET, alpha_pa=50e3)


WITHHELD: dict[str, Callable[[Bench], None]] = {
    AUTOMATIC.condition: lambda bench: bench.ask(mode=Mode.HOLD),
    CONSENT.condition: lambda bench: consents(bench, consented=False),
    NO_VETO.condition: lambda bench: consents(bench, vetoed=True),
    TRAVEL_WINDOW.condition: leave,
}
"""What may be missing to begin with, and go away under way, by the requests and the stem."""
KINDS = ("sine", "staircase", "experiment")


def under_way(kind: str) -> tuple[Bench, float]:
    bench = permitted(kind)
    law_pa = bench.step().command_pa
    ask(bench, kind)
    for _ in range(10):
        decision = bench.step()
    assert decision.state is State.S3_IDENTIFY
    return bench, law_pa


def says(decision: Decision, kind: str, row: Permissive) -> bool:
    return decision.experiment.state is row.experiment if kind == "experiment" else decision.inhibit_reason is row.why


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", WITHHELD)
def test_what_is_missing_refuses_a_test_and_it_does_not_come_later_by_itself(name: str, kind: str) -> None:
    (row,) = (each for each in PERMISSIVES if each.condition == name)
    bench = permitted(kind)
    WITHHELD[name](bench)
    ask(bench, kind)
    refused = bench.step()
    assert refused.state is not State.S3_IDENTIFY
    assert says(refused, kind, row)
    law = State.S1_UP
    if row is AUTOMATIC:
        if kind != "experiment":
            return  # asked for beside automatic: `test_a_dcs_may_write_its_registers_in_any_order`
        bench.ask(mode=Mode.AUTOMATIC)
        law = State.S0_START
    consents(bench)
    bench.position_m = 0.03
    assert {bench.step().state for _ in range(20)} == {law}
    bench.ask(eta=QUIET)
    bench.step()
    ask(bench, kind)
    assert [bench.step().state for _ in range(2)][-1] is State.S3_IDENTIFY


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", [CONSENT.condition, NO_VETO.condition, TRAVEL_WINDOW.condition])
def test_what_goes_away_ends_a_test_and_the_law_has_its_command_again(name: str, kind: str) -> None:
    (row,) = (each for each in PERMISSIVES if each.condition == name)
    bench, law_pa = under_way(kind)
    WITHHELD[name](bench)
    decisions = [bench.step() for _ in range(80)]
    at_once = decisions[0].state is State.S1_UP
    assert at_once == ("at once" in (row.experiment_later if kind == "experiment" else row.excitation_later))
    after = decisions[-1]
    assert says(after, kind, row)
    came_back_pa = BACK_PA if row is TRAVEL_WINDOW and kind != "experiment" else law_pa
    assert (after.state, after.command_pa) == (State.S1_UP, came_back_pa)
    consents(bench)
    bench.position_m = 0.03
    assert {bench.step().state for _ in range(20)} == {State.S1_UP}, "it does not come back"


@pytest.mark.parametrize("kind", KINDS)
def test_another_mode_ends_a_test_and_the_pressure_before_it_is_held(kind: str) -> None:
    bench, law_pa = under_way(kind)
    bench.ask(mode=Mode.HOLD)
    decision = bench.step()
    assert (decision.state, decision.command_pa) == (State.S0_START, law_pa)
    assert says(decision, kind, AUTOMATIC)


@pytest.mark.parametrize("kind", KINDS)
def test_a_fault_ends_a_test_in_its_own_action(kind: str) -> None:
    bench, _ = under_way(kind)
    decision = bench.step(status=DeviceStatus.SENSOR_FAULT)
    assert (decision.state, decision.fault, decision.mode) == (State.S0_START, Fault.DEVICE, Mode.HOLD)
    assert says(decision, kind, NO_FAULT)
    ask(bench, kind)
    assert bench.step().state is State.S0_START


@pytest.mark.parametrize("mode", [Mode.HOLD, Mode.MANUAL])
@pytest.mark.parametrize("kind", [each for each in KINDS if each != "experiment"])
def test_a_dcs_may_write_its_registers_in_any_order(kind: str, mode: Mode) -> None:
    bench = permitted(kind)
    bench.ask(mode=mode)
    bench.step()
    ask(bench, kind)
    assert bench.step().state is State.S0_START
    bench.ask(mode=Mode.AUTOMATIC)
    assert [bench.step().state for _ in range(2)][-1] is State.S3_IDENTIFY


@pytest.mark.parametrize(
    ("by", "asked"),
    [(Fault.DEVICE, "before"), (Mode.HOLD, "before"), (Mode.MANUAL, "before"), (Fault.DEVICE, "meanwhile")],
)
@pytest.mark.parametrize("kind", KINDS)
def test_who_chooses_automatic_again_gets_the_law_and_no_test_of_before(
    kind: str, by: Fault | Mode, asked: str
) -> None:
    bench = permitted(kind)
    if asked == "before":
        bench, _ = under_way(kind)
    if by is Fault.DEVICE:
        bench.step(status=DeviceStatus.SENSOR_FAULT)
    else:
        bench.ask(mode=by)
    bench.step()
    if asked == "meanwhile":
        ask(bench, kind)
        bench.step()
    bench.acknowledge()
    bench.step()
    bench.ask(mode=Mode.AUTOMATIC)
    decisions = [bench.step() for _ in range(20)]
    assert {each.state for each in decisions} == {State.S0_START}
    if kind != "experiment":
        assert {each.inhibit_reason for each in decisions} == {InhibitReason.EXCITATION_FROM_BEFORE}
        bench.ask(reference_m=0.06)
        assert bench.step().state is State.S1_UP, "the law goes on"
        bench.ask(eta=QUIET)
        bench.step()
    ask(bench, kind)
    assert [bench.step().state for _ in range(2)][-1] is State.S3_IDENTIFY, "asked for anew"


@pytest.mark.parametrize("kind", KINDS)
def test_who_asks_for_something_else_ends_it(kind: str) -> None:
    bench, law_pa = under_way(kind)
    ask_otherwise(bench, kind)
    decision = bench.step()
    if kind == "experiment":
        assert decision.experiment.state is ASKED.experiment
        assert decision.state is State.S3_IDENTIFY, "the excitation has its place"
    else:
        assert (decision.state, decision.command_pa) == (State.S1_UP, law_pa)


@pytest.mark.parametrize("kind", KINDS)
def test_it_begins_with_a_good_measurement_and_one_lost_later_is_nothing(kind: str) -> None:
    bench = permitted(kind)
    ask(bench, kind)
    decision = bench.step(quality=Quality.LOST)
    if kind == "experiment":
        assert decision.state is State.S3_IDENTIFY, "the last one is good enough"
    else:
        assert decision.state is State.S1_UP
        assert says(decision, kind, MEASURED)
    bench, _ = under_way(kind)
    assert bench.step(quality=Quality.LOST).state is State.S3_IDENTIFY


@pytest.mark.parametrize("kind", ["sine", "experiment"])
def test_pressures_beyond_the_limits_are_refused(kind: str) -> None:
    bench = permitted(kind)
    ask(bench, kind)
    overshoot(bench)
    decision = bench.step()
    assert decision.state is State.S1_UP
    assert says(decision, kind, PRESSURES)


def test_s3_ends_with_its_time_and_the_law_has_its_command_again() -> None:
    bench, law_pa = under_way("sine")
    decisions = [bench.step() for _ in range(100)]
    assert (decisions[-1].inhibit_reason, decisions[-1].command_pa) == (TIME.why, law_pa)
    bench = permitted("experiment")
    bench.ask(experiment=replace(bench.requests.experiment, points=((0.0, 50e3), (11.0, 50e3))))
    ask(bench, "experiment")
    assert bench.step().experiment.state is TIME.experiment


def test_by_default_s3_needs_no_consent_but_heeds_a_veto() -> None:
    bench = automatic()
    bench.ask(**EXCITING)
    assert bench.step().state is State.S3_IDENTIFY
    consents(bench, consented=False, vetoed=True)
    assert bench.step().inhibit_reason is InhibitReason.EXCITATION_VETOED


def test_every_row_is_tested_here_and_has_codes_of_its_own() -> None:
    rows = {AUTOMATIC, CONSENT, NO_VETO, TRAVEL_WINDOW, NO_FAULT, ASKED, MEASURED, PRESSURES, TIME}
    assert set(PERMISSIVES) == rows
    assert len({each.experiment for each in rows}) == len(rows)
    assert ExperimentState.NONE not in {each.experiment for each in rows}

"""A played experiment: what permits it, what breaks it off, and that the law gets its command back."""

from collections.abc import Callable
from itertools import pairwise

import pytest

from config.codes import ExperimentState, Fault, Mode, Quality, State
from positioner.control.controller_memory import Decision
from positioner.control.requests import ExperimentRequest
from positioner.estimation.acceptance import Applied
from positioner.estimation.landings.landing_detector import SlideOutcome
from positioner.estimation.landings.static_identification import StaticIdentification
from tests.control.test_controller import HELD_PA, STROKE_M, Bench, automatic

RATE = 100e3
"""Pa/s, the default."""
POINTS = ((0.0, 50e3), (0.3, 50e3), (0.5, 65e3), (1.0, 65e3))
PERIOD_S = 0.01


def asked(bench: Bench, **changes: object) -> Bench:
    """Start an experiment that is permitted but for the changes."""
    request = {"points": POINTS, "starts": 1, "consented": True} | changes
    bench.ask(experiment=ExperimentRequest(**request))  # type: ignore[arg-type]
    return bench


def played(bench: Bench, most: int = 1000) -> list[Decision]:
    """Run until the experiment has given the command back."""
    decisions = []
    for _ in range(most):
        decisions.append(bench.step())
        if not decisions[-1].experiment.commands:
            return decisions
    raise AssertionError("it never ended")


def following() -> tuple[Bench, float]:
    """Return a bench whose law moved up to a reference, and its command."""
    bench = automatic()
    bench.ask(reference_m=0.05)
    return bench, bench.step().command_pa


def test_it_plays_the_sequence_and_gives_the_law_back_without_a_bump() -> None:
    bench, law_pa = following()
    asked(bench)
    decisions = played(bench)
    commands = [law_pa, *(each.command_pa for each in decisions)]
    assert {each.state for each in decisions[:-1]} == {State.S3_IDENTIFY}
    assert 65e3 in commands
    assert decisions[-1].experiment.state is ExperimentState.COMPLETE
    assert (decisions[-1].state, decisions[-1].command_pa) == (State.S1_UP, law_pa)
    steps = [abs(after - before) for before, after in pairwise(commands)]
    assert max(steps) <= RATE * PERIOD_S * (1 + 1e-9), (
        "the rate limit holds on the way there, in it, and on the way back"
    )


def test_without_a_law_the_held_pressure_comes_back() -> None:
    bench = asked(automatic(law=None))
    decisions = played(bench)
    assert (decisions[-1].state, decisions[-1].command_pa) == (State.S0_START, HELD_PA)


def test_between_points_the_command_goes_straight() -> None:
    bench = asked(automatic())
    approach_s = (50e3 - HELD_PA) / RATE
    decisions = [bench.step() for _ in range(60)]
    at = round((approach_s + 0.4) / PERIOD_S)
    assert decisions[at].command_pa == pytest.approx(57.5e3)
    assert decisions[at].experiment.elapsed_s(bench.now_s - (59 - at) * PERIOD_S) == pytest.approx(0.4)


REFUSED: list[tuple[Callable[[], Bench], ExperimentState]] = [
    (lambda: asked(Bench()), ExperimentState.NOT_AUTOMATIC),
    (lambda: asked(automatic(), consented=False), ExperimentState.NO_CONSENT),
    (lambda: asked(automatic(), vetoed=True), ExperimentState.VETOED),
    (lambda: asked(automatic(experiment={"travel_window": (0.4, 0.9)})), ExperimentState.OUTSIDE_WINDOW),
    (lambda: asked(automatic(experiment={"maximum_pa": 59e3})), ExperimentState.BEYOND_PRESSURE),
    (lambda: asked(automatic(pressure={"maximum_pa": 59e3})), ExperimentState.BEYOND_PRESSURE),
    (lambda: asked(automatic(experiment={"minimum_pa": 51e3})), ExperimentState.BEYOND_PRESSURE),
    (lambda: asked(automatic(experiment={"rate_limit_pa_per_s": 49e3})), ExperimentState.TOO_FAST),
    (lambda: asked(automatic(experiment={"limit_s": 1.05})), ExperimentState.TOO_LONG),
    (lambda: asked(automatic(), points=()), ExperimentState.NO_SEQUENCE),
    (lambda: asked(automatic(), points=((0.0, 50e3),)), ExperimentState.NO_SEQUENCE),
    (lambda: asked(automatic(), points=((0.1, 50e3), (0.2, 50e3))), ExperimentState.NO_SEQUENCE),
    (lambda: asked(automatic(), points=((0.0, 50e3), (0.0, 50e3))), ExperimentState.NO_SEQUENCE),
    (lambda: asked(automatic(), points=((0.0, 50e3), (1.0, float("nan")))), ExperimentState.NO_SEQUENCE),
]


@pytest.mark.parametrize(("make", "why"), REFUSED, ids=lambda each: getattr(each, "name", ""))
def test_one_that_may_not_be_is_refused_and_does_not_come_later(
    make: Callable[[], Bench], why: ExperimentState
) -> None:
    bench = make()
    decision = bench.step()
    assert (decision.experiment.state, decision.command_pa) == (why, HELD_PA)
    asked(bench)
    if bench.requests.mode is not Mode.AUTOMATIC:
        bench.ask(mode=Mode.AUTOMATIC)
    assert {bench.step().command_pa for _ in range(30)} == {HELD_PA}, "permitted now, but it was not asked for anew"


def test_while_eta_asks_for_another_excitation_it_is_refused() -> None:
    bench = asked(automatic())
    bench.ask(eta=(0, 0, 0))
    assert bench.step().experiment.state is ExperimentState.EXCITED


def test_before_the_first_measurement_it_is_refused() -> None:
    bench = asked(Bench())
    bench.ask(mode=Mode.AUTOMATIC)
    assert bench.step(quality=Quality.LOST).experiment.state is ExperimentState.NO_MEASUREMENT


@pytest.mark.parametrize("quality", [Quality.REPEATED, Quality.LOST])
def test_a_sample_that_is_not_new_does_not_refuse_it(quality: Quality) -> None:
    bench = asked(automatic())
    assert bench.step(quality=quality).experiment.state is ExperimentState.UNDER_WAY


def test_a_sample_that_is_not_new_does_not_hide_where_the_stem_was() -> None:
    bench = asked(automatic(experiment={"travel_window": (0.4, 0.9)}))
    assert bench.step(quality=Quality.LOST).experiment.state is ExperimentState.OUTSIDE_WINDOW


def test_nothing_is_played_at_the_start_whatever_is_asked_then() -> None:
    bench = Bench()
    asked(bench)
    assert {bench.step().command_pa for _ in range(30)} == {HELD_PA}


BROKEN_OFF: list[tuple[Callable[[Bench], object], ExperimentState]] = [
    (lambda bench: asked(bench, vetoed=True), ExperimentState.VETOED),
    (lambda bench: asked(bench, consented=False), ExperimentState.NO_CONSENT),
    (lambda bench: setattr(bench, "position_m", 0.97 * STROKE_M), ExperimentState.OUTSIDE_WINDOW),
]


@pytest.mark.parametrize(("stop", "why"), BROKEN_OFF, ids=lambda each: getattr(each, "name", ""))
def test_broken_off_it_goes_back_at_the_rate_limit(stop: Callable[[Bench], object], why: ExperimentState) -> None:
    bench, law_pa = following()
    asked(bench)
    before_pa = [bench.step() for _ in range(20)][-1].command_pa
    stop(bench)
    decisions = played(bench)
    commands = [before_pa, *(each.command_pa for each in decisions)]
    steps = [abs(after - before) for before, after in pairwise(commands)]
    assert max(steps) <= RATE * PERIOD_S * (1 + 1e-9)
    assert decisions[0].experiment.state is ExperimentState.RETURNING
    assert decisions[-1].experiment.state is why
    assert (decisions[-1].state, decisions[-1].command_pa) == (State.S1_UP, law_pa)
    assert 65e3 not in commands, "it was not played to its end"


@pytest.mark.parametrize(("action", "safe_pa"), [("hold", HELD_PA), ("vent", 0.0), ("fill", 420e3)])
def test_a_fault_in_the_middle_ends_in_the_safe_state_and_nothing_is_resumed(action: str, safe_pa: float) -> None:
    bench = asked(automatic(law=None, safety={"action": action}))
    for _ in range(50):
        bench.step()
    decision = [bench.step(quality=Quality.LOST) for _ in range(3)][-1]
    assert (decision.fault, decision.mode, decision.state) == (Fault.NO_REPLY, Mode.HOLD, State.S0_START)
    assert (decision.command_pa, decision.experiment.state) == (safe_pa, ExperimentState.FAULT)
    bench.acknowledge()
    bench.ask(mode=Mode.AUTOMATIC)
    assert {bench.step().command_pa for _ in range(50)} == {safe_pa}


def test_another_mode_ends_it_at_once_and_automatic_does_not_bring_it_back() -> None:
    bench = asked(automatic(law=None))
    for _ in range(50):
        bench.step()
    bench.ask(mode=Mode.HOLD)
    decision = bench.step()
    assert (decision.experiment.state, decision.command_pa) == (ExperimentState.NOT_AUTOMATIC, HELD_PA)
    bench.ask(mode=Mode.AUTOMATIC)
    assert {bench.step().command_pa for _ in range(50)} == {HELD_PA}


def test_what_the_law_uses_is_not_changed_by_landings_in_it(monkeypatch: pytest.MonkeyPatch) -> None:
    bench, _ = following()
    landing = SlideOutcome(0.0, 1, 0.02, 50e3, 0.03, 1e-5, moved=True, landing=True)
    corrected: list[Applied] = []

    def note(_: StaticIdentification, applied: Applied) -> Applied:
        corrected.append(applied)
        return applied

    monkeypatch.setattr(StaticIdentification, "update", lambda *_, **__: landing)
    monkeypatch.setattr(StaticIdentification, "corrected", note)
    asked(bench)
    played(bench)
    assert len(corrected) == 1, "that of the first step after it"


RAMP = ((0.0, HELD_PA), (0.2, HELD_PA), (0.7, HELD_PA + 40e3))


def moving_with_its_command(bench: Bench, m_per_pa: float = 1e-7, most: int = 1000) -> list[Decision]:
    """Run until the command is given back, the stem going straight with the command."""
    decisions = []
    for _ in range(most):
        decisions.append(bench.step(position_m=0.05 + m_per_pa * (bench.controller.command_pa - HELD_PA)))
        if not decisions[-1].experiment.commands:
            return decisions
    raise AssertionError("it never ended")


def test_at_its_travel_it_turns_and_retraces_its_way_at_its_own_pace() -> None:
    bench = asked(automatic(law=None), points=RAMP, turn_m=2e-3)
    decisions = moving_with_its_command(bench)
    commands = [each.command_pa for each in decisions]
    top = max(commands)
    assert HELD_PA + 20e3 < top < HELD_PA + 24e3, "where it had gone 2 mm, and the median of five samples"
    assert decisions[-1].experiment.state is ExperimentState.TURNED
    steps = {round(abs(after - before)) for before, after in pairwise(commands)}
    assert max(steps) <= 80e3 * PERIOD_S * 1.01, "the ramp's own pace, not the rate limit's"
    peak = commands.index(top)
    for back in range(20):
        assert commands[peak + 1 + back] == pytest.approx(commands[peak - back], abs=2.0 * 80e3 * PERIOD_S)


def test_beyond_its_band_it_is_broken_off() -> None:
    decisions = moving_with_its_command(asked(automatic(law=None), points=RAMP, turn_m=5e-3, band_m=1e-3))
    assert decisions[-1].experiment.state is ExperimentState.BEYOND_BAND
    assert decisions[-1].command_pa == HELD_PA


def test_a_veto_ends_it_on_its_way_back_too() -> None:
    bench = asked(automatic(law=None), points=((0.0, HELD_PA), (10.0, HELD_PA + 40e3)), turn_m=2e-3)
    for _ in range(700):
        bench.step(position_m=0.05 + 1e-7 * (bench.controller.command_pa - HELD_PA))
    asked(bench, points=RAMP, vetoed=True)
    assert moving_with_its_command(bench, most=60)[-1].experiment.state is ExperimentState.VETOED


@pytest.mark.parametrize(("window", "broken_off"), [((0.05, 0.95), True), ((0.0, 1.0), False)])
def test_a_window_that_reaches_the_stops_ends_at_none_of_their_readings(
    window: tuple[float, float], broken_off: bool
) -> None:
    bench = asked(automatic(law=None, experiment={"travel_window": window}))
    states = [bench.step(position_m=each).experiment.state for each in (0.05, -0.001, STROKE_M + 0.001, 0.05)]
    assert (ExperimentState.RETURNING in states) is broken_off

"""The control core on a scripted stem: modes, states, what is held, what is given back."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf, isfinite, nan
from typing import ClassVar, Self

import pytest

from config.codes import Fault, InhibitReason, Mode, Quality, State
from config.daemon_file import DaemonFile
from config.quantities import DeviceStatus
from positioner.control.controller import Controller
from positioner.control.controller_memory import Decision
from positioner.control.laws.boundary import Law, LawSettings, Seen, Unlearning
from positioner.control.requests import QUIET, Requests
from positioner.control.sample import Sample
from positioner.control.settings import Settings
from positioner.control.sine_excitation import SineExcitation

HELD_PA = 40e3
STROKE_M = 0.1
LAW = {"b_over_c_pa_per_m": -800e3, "k_over_c_pa": -20e3}
BETA_PA = 13e3


@dataclass
class ScriptedSettings:
    """Settings of a law that asks for what a test says, and else for what another does."""

    other: LawSettings
    asks: object = None
    """What the law says from now on for a pressure; None: what the other does."""

    by_single_steps: ClassVar[bool] = False

    @classmethod
    def of(cls, file: DaemonFile) -> Self:
        raise NotImplementedError

    def begin(self, held_pa: float) -> "ScriptedLaw":
        return ScriptedLaw(self, self.other.begin(held_pa))


@dataclass(frozen=True)
class ScriptedLaw(Unlearning):
    script: ScriptedSettings
    other: Law

    @property
    def command_pa(self) -> float:
        return self.interrupted_pa(self.other.command_pa)

    @property
    def inhibit_reason(self) -> InhibitReason:
        return self.other.inhibit_reason

    def observe(self, seen: Seen) -> "ScriptedLaw":
        return replace(self, other=self.other.observe(seen))

    def interrupted_pa(self, command_pa: float) -> float:
        return command_pa if self.script.asks is None else self.script.asks  # type: ignore[return-value]


class Bench:
    """A controller, the requests of its DCS and the time; the stem stays where the test puts it."""

    def __init__(self, **tables: object) -> None:
        control = tables.pop("control", {})
        assert isinstance(control, dict)
        own = {"control": {"law": "seed", **control}, **tables}
        file = DaemonFile.model_validate({"valve": {"stroke_m": STROKE_M}, "law": LAW, **own})
        settings = Settings.of(file)
        self.law = ScriptedSettings(settings.law)
        self.controller = Controller(replace(settings, law=self.law), HELD_PA)
        self.requests = Requests(beta_pa=BETA_PA)
        self.now_s = 0.0
        self.position_m = 0.03

    def ask(self, **values: object) -> None:
        """Write registers; the counts that make them events grow by one."""
        counts = {"reference_m": "reference_writes", "mode": "mode_writes", "manual_pa": "manual_writes"}
        written = {count: getattr(self.requests, count) + 1 for name, count in counts.items() if name in values}
        self.requests = replace(self.requests, **values, **written)  # type: ignore[arg-type]

    def acknowledge(self) -> None:
        self.ask(acknowledgements=self.requests.acknowledgements + 1)

    def step(self, **sample: object) -> Decision:
        """Run one cycle of 10 ms."""
        self.now_s += 0.01
        seen = Sample(self.now_s, self.now_s, self.position_m, self.controller.command_pa)
        return self.controller.step(seen._replace(**sample), self.requests)  # type: ignore[arg-type]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def automatic(**tables: object) -> Bench:
    bench = Bench(**tables)
    bench.step()
    bench.ask(mode=Mode.AUTOMATIC)
    bench.step()
    return bench


def test_nothing_moves_the_valve_until_asked(bench: Bench) -> None:
    for _ in range(50):
        decision = bench.step()
        assert (decision.command_pa, decision.state, decision.mode) == (HELD_PA, State.S0_START, Mode.HOLD)


@pytest.mark.parametrize(
    "asked",
    [{"reference_m": 0.08}, {"manual_pa": 60e3}, {"eta": (0, 0, 0)}, {"alpha_pa": 60e3}],
    ids=lambda asked: next(iter(asked)),
)
def test_in_hold_no_request_but_a_mode_moves_it(bench: Bench, asked: dict[str, object]) -> None:
    bench.ask(**asked)
    assert {bench.step().command_pa for _ in range(20)} == {HELD_PA}


def test_automatic_without_a_new_reference_holds() -> None:
    decision = automatic().step()
    assert (decision.command_pa, decision.inhibit_reason) == (HELD_PA, InhibitReason.NO_MOVE_ASKED)


def test_up_and_down_follow_the_law_and_delta_r_is_kept() -> None:
    bench = automatic()
    bench.ask(reference_m=0.05)
    for _ in range(3):
        up = bench.step()
        assert up.state is State.S1_UP
        assert up.delta_r_m == pytest.approx(0.02)
        assert up.command_pa == pytest.approx(800e3 * 0.05 + 20e3)
    bench.ask(reference_m=0.04)
    for _ in range(3):
        down = bench.step()
        assert down.state is State.S2_DOWN
        assert down.delta_r_m == pytest.approx(-0.01)
        assert down.command_pa == pytest.approx(800e3 * 0.04 - 20e3)


@pytest.mark.parametrize(("before_m", "direction"), [(0.04, 1), (0.06, -1)])
def test_a_sine_whose_alpha_nobody_says_swings_about_the_balance_of_the_law(before_m: float, direction: int) -> None:
    bench = automatic()
    for reference_m in (before_m, 0.05):
        bench.ask(reference_m=reference_m)
        bench.step()
    bench.ask(eta=(0, 0, 0), alpha_pa=0.0, omega_rad_per_s=100.0)
    swings = [bench.step() for _ in range(63)]
    assert {each.state for each in swings} == {State.S3_IDENTIFY}
    ends_pa = [end(each.command_pa for each in swings) for end in (min, max)]
    about_pa = 800e3 * 0.05 + direction * 20e3
    assert ends_pa == pytest.approx([about_pa - BETA_PA, about_pa + BETA_PA], abs=0.02 * BETA_PA)


def test_a_reference_written_before_automatic_is_followed_once_it_is() -> None:
    bench = Bench()
    bench.ask(reference_m=0.05)
    bench.step()
    bench.ask(mode=Mode.AUTOMATIC)
    decision = bench.step()
    assert decision.state is State.S1_UP
    assert decision.delta_r_m == pytest.approx(0.02)


def test_an_old_reference_does_not_come_back_with_automatic() -> None:
    bench = automatic()
    bench.ask(reference_m=0.05)
    command_pa = bench.step().command_pa
    bench.ask(mode=Mode.HOLD)
    bench.position_m = 0.08
    assert bench.step().command_pa == command_pa
    bench.ask(mode=Mode.AUTOMATIC)
    decision = bench.step()
    assert (decision.state, decision.command_pa) == (State.S0_START, command_pa)


def test_the_law_waits_for_estimates() -> None:
    bench = automatic(law=None)
    bench.ask(reference_m=0.05)
    decision = bench.step()
    assert (decision.state, decision.inhibit_reason, decision.command_pa) == (
        State.S0_START,
        InhibitReason.NO_ESTIMATES,
        HELD_PA,
    )


def test_manual_applies_what_was_written_and_leaves_no_trace() -> None:
    bench = Bench()
    bench.ask(mode=Mode.MANUAL)
    assert bench.step().command_pa == HELD_PA, "bumpless: nothing was written yet"
    bench.ask(manual_pa=60e3)
    assert bench.step().command_pa == 60e3
    bench.ask(mode=Mode.HOLD)
    assert bench.step().command_pa == 60e3
    bench.ask(mode=Mode.AUTOMATIC)
    bench.ask(reference_m=0.06)
    law_pa = bench.step().command_pa
    bench.ask(mode=Mode.MANUAL)
    assert bench.step().command_pa == law_pa != 60e3, "the old manual pressure does not come back"


def test_commands_stay_within_the_pressure_limits() -> None:
    bench = automatic(pressure={"minimum_pa": 10e3, "maximum_pa": 90e3})
    bench.ask(reference_m=0.1)
    high = bench.step()
    assert (high.command_pa, high.inhibit_reason) == (90e3, InhibitReason.LAW_BEYOND_LIMITS)
    bench.ask(reference_m=0.001)
    low = bench.step()
    assert (low.command_pa, low.inhibit_reason) == (10e3, InhibitReason.LAW_BEYOND_LIMITS)


def test_s3_excites_and_gives_back_the_law() -> None:
    bench = automatic()
    bench.ask(reference_m=0.05)
    law_pa = bench.step().command_pa
    bench.ask(eta=(0, 0, 0), alpha_pa=50e3)
    first, later = bench.step(), [bench.step() for _ in range(50)][-1]
    assert (first.state, first.command_pa) == (State.S3_IDENTIFY, 50e3)
    assert later.command_pa > 50e3 + 0.4 * BETA_PA
    bench.ask(eta=QUIET)
    back = bench.step()
    assert (back.state, back.command_pa) == (State.S1_UP, law_pa)


def test_s3_gives_back_the_pressure_that_s0_held() -> None:
    bench = automatic(law=None)
    bench.ask(eta=(0, 0, 0), alpha_pa=50e3)
    bench.step()
    assert bench.step().command_pa != HELD_PA
    bench.ask(eta=QUIET)
    assert [bench.step().command_pa for _ in range(3)] == [HELD_PA] * 3


@pytest.mark.parametrize("reference_m", [0.05, 0.028])
def test_s3_by_default_starts_from_what_keeps_the_stem(reference_m: float) -> None:
    bench = automatic()
    bench.ask(reference_m=reference_m, beta_pa=1e3)
    law_pa = bench.step().command_pa
    bench.ask(eta=(0, 0, 0))
    assert bench.step().command_pa == pytest.approx(law_pa)
    unknown = automatic(law=None)
    unknown.ask(eta=(0, 0, 0))
    assert unknown.step().command_pa == HELD_PA


@pytest.mark.parametrize(
    ("tables", "asked", "why"),
    [
        (
            {"valve": {"stroke_m": STROKE_M, "breakaway_pa": 26e3}},
            {"alpha_pa": 26e3},
            InhibitReason.ALPHA_BELOW_BREAKAWAY,
        ),
        ({}, {"beta_pa": 0.0}, InhibitReason.AMPLITUDE_ZERO),
        ({"pressure": {"maximum_pa": 52e3}}, {"alpha_pa": 40e3}, InhibitReason.EXCITATION_BEYOND_LIMITS),
    ],
)
def test_an_excitation_that_may_not_be_is_refused_and_says_why(
    tables: dict[str, object], asked: dict[str, object], why: InhibitReason
) -> None:
    bench = automatic(**tables)
    bench.ask(eta=(0, 0, 0), **asked)
    decision = bench.step()
    assert (decision.state, decision.inhibit_reason, decision.command_pa) == (State.S0_START, why, HELD_PA)


def test_s3_ends_by_itself_and_does_not_begin_again_until_asked_again() -> None:
    bench = automatic(excitation={"limit_s": 0.2})
    bench.ask(eta=(0, 0, 0), alpha_pa=50e3)
    states = [bench.step().state for _ in range(40)]
    assert states[:20] == [State.S3_IDENTIFY] * 20
    assert states[22:] == [State.S0_START] * 18
    assert bench.step().inhibit_reason is InhibitReason.EXCITATION_TOO_LONG
    assert bench.step().command_pa == HELD_PA
    bench.ask(eta=QUIET)
    bench.step()
    bench.ask(eta=(0, 0, 0))
    assert bench.step().state is State.S3_IDENTIFY


def test_an_identification_without_motion_replaces_nothing() -> None:
    bench = automatic()
    before = bench.step().applied
    bench.ask(eta=(0, 0, 0), alpha_pa=50e3)
    for _ in range(100):
        bench.step()
    bench.ask(eta=QUIET)
    after = bench.step().applied
    assert after.ratios == before.ratios
    assert (after.count, after.refusals) == (0, 1)


Fail = Callable[[Bench], Decision]


def lose(bench: Bench) -> Decision:
    return [bench.step(quality=Quality.LOST) for _ in range(3)][-1]


def jump(bench: Bench) -> Decision:
    return [bench.step(position_m=1.0) for _ in range(3)][-1]


def break_down(bench: Bench) -> Decision:
    return bench.step(status=DeviceStatus.SENSOR_FAULT)


def stand_still(bench: Bench) -> Decision:
    return [bench.step(quality=Quality.REPEATED) for _ in range(12)][-1]


def stall(bench: Bench) -> Decision:
    return bench.step(unattended_s=2.0)


NO_PRESSURES = [nan, inf, -inf, "60000", (60e3,), 60e3 + 0j]
"""What a law says that has divided by zero, or gives no number at all."""


def broken_by(asks: object) -> Fail:
    def say(bench: Bench) -> Decision:
        bench.law.asks = asks
        decision = bench.step()
        bench.law.asks = None
        return decision

    return say


FAILURES = [
    (broken_by(nan), Fault.COMMAND_NOT_FINITE),
    (broken_by("60000"), Fault.COMMAND_NOT_FINITE),
    (lose, Fault.NO_REPLY),
    (jump, Fault.IMPLAUSIBLE),
    (break_down, Fault.DEVICE),
    (stand_still, Fault.STALE),
    (stall, Fault.STALLED),
]


@pytest.mark.parametrize(("fail", "fault"), FAILURES)
@pytest.mark.parametrize(("action", "command_pa"), [("hold", 60e3), ("vent", 0.0), ("fill", 420e3)])
def test_every_fault_ends_in_the_configured_safe_state(
    fail: Fail, fault: Fault, action: str, command_pa: float
) -> None:
    bench = automatic(safety={"action": action})
    bench.ask(reference_m=0.05)
    bench.step()
    decision = fail(bench)
    assert (decision.fault, decision.mode, decision.state) == (fault, Mode.HOLD, State.S0_START)
    assert decision.command_pa == pytest.approx(command_pa)
    bench.step()
    assert bench.step().command_pa == pytest.approx(command_pa), "and stays there"


@pytest.mark.parametrize(("fail", "fault"), FAILURES)
def test_recovery_moves_nothing_before_the_mode_is_chosen_again(fail: Fail, fault: Fault) -> None:
    bench = automatic(safety={"action": "vent"})
    bench.ask(reference_m=0.05)
    bench.step()
    assert fail(bench).fault is fault
    assert bench.step().fault is fault, "latched"
    bench.acknowledge()
    free = bench.step()
    assert (free.fault, free.mode, free.command_pa) == (Fault.NONE, Mode.HOLD, 0.0)
    bench.ask(mode=Mode.AUTOMATIC)
    assert bench.step().command_pa == 0.0, "the reference of before the fault is void"
    bench.ask(reference_m=0.06)
    assert bench.step().state is State.S1_UP


@pytest.mark.parametrize("mode", [Mode.AUTOMATIC, Mode.HOLD])
@pytest.mark.parametrize("asks", NO_PRESSURES)
def test_a_command_that_is_not_finite_never_leaves_and_the_last_one_is_held(mode: Mode, asks: object) -> None:
    """In hold it is what follows an interruption that is none. A text, which is no number, is none either."""
    bench = automatic()
    bench.ask(reference_m=0.05)
    before_pa = bench.step().command_pa
    bench.ask(mode=mode)
    bench.law.asks = asks
    failed = bench.step()
    assert (failed.fault, failed.state, failed.mode) == (Fault.COMMAND_NOT_FINITE, State.S0_START, Mode.HOLD)
    assert failed.command_pa == before_pa
    assert {bench.step().command_pa for _ in range(5)} == {before_pa}
    assert bench.controller.left_pa == before_pa, "and so it leaves the valve"


@pytest.mark.parametrize("excitation", ["staircase", "sine"])
def test_nor_does_one_of_an_excitation(excitation: str) -> None:
    bench = automatic(excitation={"kind": excitation})
    bench.ask(eta=(0, 0, 0), alpha_pa=50e3)
    before_pa = bench.step().command_pa
    memory = bench.controller._memory
    assert memory.excitation is not None
    broken = replace(memory.excitation, signal=SineExcitation(nan, BETA_PA, 1.0))
    bench.controller._memory = memory._replace(excitation=broken)
    failed = bench.step()
    assert (failed.fault, isfinite(failed.command_pa)) == (Fault.COMMAND_NOT_FINITE, True)
    assert failed.command_pa == before_pa


def test_a_restarted_device_keeps_the_pressure_it_came_back_with() -> None:
    bench = automatic()
    bench.ask(reference_m=0.05)
    bench.step()
    decision = bench.step(held_pa=5e3)
    assert (decision.fault, decision.command_pa) == (Fault.RESTARTED, 5e3)
    assert bench.step().command_pa == 5e3


@pytest.mark.parametrize(
    ("status", "action", "command_pa"),
    [
        (DeviceStatus.NOT_READY, "hold", 33e3),
        (DeviceStatus.NOT_READY, "vent", 0.0),
        (DeviceStatus.SENSOR_FAULT, "hold", 60e3),
    ],
)
def test_a_device_that_does_not_obey_stays_where_it_is_when_it_does_again(
    status: DeviceStatus, action: str, command_pa: float
) -> None:
    """Operated locally it goes where its operator wants it; with the command of before it would leave that at once."""
    bench = automatic(safety={"action": action})
    bench.ask(reference_m=0.05)
    assert bench.step().command_pa == pytest.approx(60e3)
    for shown_pa in (60e3, 45e3, 33e3):
        decision = bench.step(status=status, pressure_pa=shown_pa)
    assert decision.fault is Fault.DEVICE
    assert decision.command_pa == pytest.approx(command_pa)
    bench.step(status=status, pressure_pa=90e3, quality=Quality.REPEATED)
    assert bench.step(pressure_pa=31e3).command_pa == pytest.approx(command_pa), "it obeys again, and is held"
    bench.acknowledge()
    assert bench.step().command_pa == pytest.approx(command_pa)


def test_a_device_that_was_restarted_unseen_is_one_though_it_has_its_command_again() -> None:
    bench = automatic()
    bench.ask(reference_m=0.05)
    command_pa = bench.step().command_pa
    decision = bench.step(held_pa=command_pa, restarted=True)
    assert (decision.fault, decision.mode, decision.command_pa) == (Fault.RESTARTED, Mode.HOLD, command_pa)


def test_a_silent_dcs_has_an_action_of_its_own() -> None:
    bench = Bench(safety={"action": "vent", "heartbeat_timeout_s": 0.5, "heartbeat_action": "hold"})
    bench.step()
    bench.ask(mode=Mode.AUTOMATIC, reference_m=0.05)
    decisions = [bench.step() for _ in range(60)]
    assert decisions[40].fault is Fault.NONE
    assert decisions[-1].fault is Fault.DCS_SILENT
    assert decisions[-1].command_pa == pytest.approx(60e3)


@pytest.mark.parametrize(
    "asked", [{"mode": Mode.MANUAL, "manual_pa": 60e3}, {"mode": Mode.AUTOMATIC, "reference_m": 0.08}]
)
def test_who_chooses_a_mode_while_the_heartbeat_is_silent_moves_nothing(asked: dict[str, object]) -> None:
    """One cycle of the mode before the fault would be a command, and the fault would hold that."""
    bench = Bench(safety={"heartbeat_timeout_s": 0.5})
    for _ in range(60):
        bench.step()
    bench.ask(**asked)
    decisions = [bench.step() for _ in range(5)]
    assert {(each.mode, each.fault, each.command_pa) for each in decisions} == {(Mode.HOLD, Fault.DCS_SILENT, HELD_PA)}
    bench.ask(heartbeats=1, acknowledgements=1)
    bench.step()
    bench.ask(**asked)
    assert bench.step().mode is asked["mode"]


def test_a_beating_heart_keeps_it_going() -> None:
    bench = Bench(safety={"heartbeat_timeout_s": 0.05})
    bench.ask(mode=Mode.AUTOMATIC)
    for beat in range(30):
        bench.ask(heartbeats=beat)
        assert bench.step().fault is Fault.NONE

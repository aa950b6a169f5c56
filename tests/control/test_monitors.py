"""The monitors of table `[supervision]`: what each finds, after which delay, what it ends in; on a scripted stem."""

from collections.abc import Callable

import pytest

from config.codes import Fault, Mode, Quality, State
from config.daemon_file import DaemonFile
from config.errors import InputError
from config.loading import validate
from config.quantities import DeviceStatus
from positioner.control.controller_memory import Decision
from positioner.control.monitors import (
    IN_VAIN,
    UNKNOWN_S,
    MonitorMemory,
    MonitorSettings,
    after_cycle,
    needs_of,
)
from positioner.control.rest_band import RestBand
from positioner.estimation.acceptance import Ratios
from tests.control.test_controller import LAW, STROKE_M, Bench, automatic

Finds = Callable[[Bench], Decision]


def deviates(bench: Bench) -> Decision:
    """The reference is 0.05 m; the stem stays at 0.03."""
    bench.ask(reference_m=0.05)
    bench.step()
    return bench.step()


def is_frozen(bench: Bench) -> Decision:
    bench.ask(mode=Mode.MANUAL, manual_pa=40e3)
    bench.step()
    bench.ask(manual_pa=300e3)
    return [bench.step() for _ in range(round(100 * UNKNOWN_S) + IN_VAIN + 3)][-1]


def jumps(bench: Bench) -> Decision:
    """20 mm in 10 ms."""
    bench.position_m += 0.02
    return bench.step()


def is_saturated(bench: Bench) -> Decision:
    bench.ask(mode=Mode.MANUAL, manual_pa=419e3)
    bench.step()
    return bench.step()


def is_late(bench: Bench) -> Decision:
    bench.now_s += 0.04
    return bench.step()


def is_fast(bench: Bench) -> Decision:
    bench.ask(mode=Mode.MANUAL, manual_pa=60e3)
    bench.step()
    return bench.step()


MONITORS: dict[str, tuple[Finds, Fault, float]] = {
    "travel_deviation": (deviates, Fault.TRAVEL_DEVIATION, 0.1),
    "frozen_sensor": (is_frozen, Fault.FROZEN_SENSOR, 1.25),
    "position_rate": (jumps, Fault.POSITION_RATE, 10.0),
    "saturation": (is_saturated, Fault.SATURATED, 0.01),
    "overrun": (is_late, Fault.OVERRUN, 3.0),
    "command_rate": (is_fast, Fault.COMMAND_RATE, 1.0),
}
QUIET: dict[str, object] = {name: {"threshold": 0.0} for name in MONITORS}


def watched(name: str, **keys: object) -> Bench:
    _, _, threshold = MONITORS[name]
    monitor = {"threshold": threshold, "delay_s": 0.0, **keys}
    return automatic(
        supervision=QUIET | {name: monitor},
        cycle={"period_s": 0.01},
        safety={"action": "fill", "safe_pressure_pa": 9e3},
    )


@pytest.mark.parametrize("name", MONITORS)
@pytest.mark.parametrize(("action", "command_pa"), [("vent", 0.0), ("fill", 420e3), ("safe", 9e3), ("hold", None)])
def test_a_monitor_ends_in_its_own_action(name: str, action: str, command_pa: float | None) -> None:
    finds, fault, _ = MONITORS[name]
    bench = watched(name, action=action)
    before_pa = bench.step().command_pa
    decision = finds(bench)
    assert (decision.fault, decision.mode) == (fault, Mode.HOLD)
    assert fault in decision.alarms
    if command_pa is None:
        held_pa = decision.command_pa
        assert name != "position_rate" or held_pa == before_pa
        assert bench.step().command_pa == held_pa
    else:
        assert decision.command_pa == command_pa


@pytest.mark.parametrize("name", MONITORS)
def test_an_alarm_is_told_and_changes_nothing(name: str) -> None:
    finds, fault, _ = MONITORS[name]
    told, quiet = watched(name, action="alarm"), automatic(supervision=QUIET)
    for bench in (told, quiet):
        bench.step()
    decision, without = finds(told), finds(quiet)
    assert (decision.fault, decision.alarms) == (Fault.NONE, (fault,))
    assert (decision.command_pa, decision.mode) == (without.command_pa, without.mode)
    assert (without.fault, without.alarms) == (Fault.NONE, ())


@pytest.mark.parametrize("name", ["travel_deviation", "saturation"])
def test_what_does_not_last_for_its_delay_is_nothing(name: str) -> None:
    finds, fault, _ = MONITORS[name]
    bench = watched(name, delay_s=0.1, action="vent")
    assert finds(bench).alarms == ()
    decisions = [bench.step() for _ in range(12)]
    assert [each.fault for each in decisions[:8]] == [Fault.NONE] * 8
    assert decisions[-1].fault is fault


def test_a_frozen_sensor_is_none_where_the_stem_may_stand_at_its_end() -> None:
    for position_m, found in ((0.05, True), (0.001, False), (STROKE_M, False)):
        bench = watched("frozen_sensor", action="alarm")
        bench.position_m = position_m
        bench.step()
        assert (is_frozen(bench).alarms == (Fault.FROZEN_SENSOR,)) is found


@pytest.mark.parametrize(("off_pa", "found"), [(0.0, True), (-60e3, False), (90e3, True)])
def test_a_stem_whose_pressure_stays_away_is_not_frozen(off_pa: float, found: bool) -> None:
    """A low supply; a register that never was the actuator's pressure says nothing of it."""
    bench = automatic(supervision=QUIET | {"frozen_sensor": {"threshold": 1.25, "action": "alarm"}})
    elsewhere_pa = max(0.0, off_pa)
    bench.step(pressure_pa=bench.controller.command_pa + elsewhere_pa)
    bench.ask(reference_m=0.09)
    told = [bench.step(pressure_pa=bench.controller.command_pa + off_pa) for _ in range(150)]
    assert (told[-1].alarms == (Fault.FROZEN_SENSOR,)) is found


@pytest.mark.parametrize("threshold", [0.5, 0.99])
def test_a_share_of_the_span_is_refused_by_name_of_its_key(threshold: float) -> None:
    table = {"valve": {"stroke_m": 0.1}, "supervision": {"frozen_sensor": {"threshold": threshold}}}
    with pytest.raises(InputError, match=r"supervision\.frozen_sensor\.threshold.*0 \(not watched\) and 1 upward"):
        validate(DaemonFile, table, "d.toml")


def test_a_lost_reply_is_no_jump() -> None:
    """The rate is that over the whole time without a measurement."""
    bench = watched("position_rate", action="hold")
    bench.step()
    for _ in range(2):
        bench.step(quality=Quality.LOST)
    bench.position_m += 0.025
    assert bench.step().fault is Fault.NONE, "25 mm in 30 ms"


def test_an_acknowledgement_begins_anew() -> None:
    """A stem that really is stuck must not keep the operator from moving it by hand."""
    bench = watched("frozen_sensor", action="hold")
    assert is_frozen(bench).fault is Fault.FROZEN_SENSOR
    bench.acknowledge()
    assert bench.step().fault is Fault.NONE
    bench.ask(mode=Mode.MANUAL)
    assert bench.step().mode is Mode.MANUAL


@pytest.mark.parametrize("law", [LAW, None])
def test_by_default_a_sensor_that_stands_still_is_a_fault_and_a_slow_cycle_an_alarm(law: dict[str, float]) -> None:
    bench = automatic(cycle={"period_s": 0.01}, law=law)
    assert is_frozen(bench).fault is Fault.FROZEN_SENSOR
    bench = automatic(cycle={"period_s": 0.01})
    for _ in range(40):
        decision = is_late(bench)
    assert (decision.fault, decision.alarms) == (Fault.NONE, (Fault.OVERRUN,))


@pytest.mark.parametrize(
    ("safety", "said"),
    [
        ({"action": "safe"}, 'safety.safe_pressure_pa is required by the action "safe" and missing'),
        ({"safe_pressure_pa": 1e6}, "safety.safe_pressure_pa: allowed is 0 to 420000 Pa"),
    ],
)
def test_a_safe_pressure_that_is_none_is_one_line(safety: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        validate(
            DaemonFile,
            {"valve": {"stroke_m": STROKE_M}, "law": LAW, "safety": safety},
            "daemon.toml",
        )


@pytest.mark.parametrize("name", MONITORS)
def test_what_is_to_be_met_by_hand_is_held_until_an_operator_writes_a_pressure(name: str) -> None:
    finds, fault, _ = MONITORS[name]
    bench = watched(name, action="manual")
    decision = finds(bench)
    assert (decision.fault, decision.mode, decision.state) == (fault, Mode.MANUAL, State.S0_START)
    held_pa = decision.command_pa
    assert bench.step().command_pa == held_pa, "the law has let go, and nothing that was written before comes back"
    bench.ask(reference_m=0.09)
    assert bench.step().command_pa == held_pa
    bench.ask(manual_pa=held_pa - 7e3)
    by_hand = bench.step()
    assert (by_hand.command_pa, by_hand.fault, by_hand.mode) == (held_pa - 7e3, fault, Mode.MANUAL)
    bench.ask(mode=Mode.HOLD)
    held = bench.step()
    assert (held.mode, held.command_pa, held.fault) == (Mode.HOLD, held_pa - 7e3, fault), (
        "hold is to be had at any time"
    )


def test_an_acknowledgement_leaves_the_valve_to_the_operator_who_has_it() -> None:
    bench = watched("position_rate", action="manual")
    jumps(bench)
    bench.ask(manual_pa=45e3)
    bench.step()
    bench.acknowledge()
    free = bench.step()
    assert (free.fault, free.mode, free.command_pa) == (Fault.NONE, Mode.MANUAL, 45e3)


def test_who_does_not_command_gets_nothing_by_hand_from_a_fault() -> None:
    """In hold no request but a mode moves the valve, fault or not."""
    bench = watched("position_rate", action="manual")
    bench.ask(mode=Mode.HOLD, manual_pa=300e3)
    bench.step()
    decision = jumps(bench)
    assert (decision.fault, decision.mode) == (Fault.POSITION_RATE, Mode.HOLD)
    bench.ask(manual_pa=310e3)
    assert bench.step().command_pa == decision.command_pa


def test_another_fault_takes_the_valve_from_the_operator() -> None:
    bench = watched("position_rate", action="manual")
    jumps(bench)
    bench.ask(manual_pa=45e3)
    bench.step()
    lost = [bench.step(quality=Quality.LOST) for _ in range(3)][-1]
    assert (lost.fault, lost.mode, lost.command_pa) == (Fault.NO_REPLY, Mode.HOLD, 420e3)


def test_a_safe_action_is_no_fast_command() -> None:
    bench = watched("command_rate", action="hold")
    unfit = [bench.step(status=DeviceStatus.SENSOR_FAULT) for _ in range(5)]
    assert {each.fault for each in unfit} == {Fault.DEVICE}
    assert unfit[-1].command_pa == 420e3


@pytest.mark.parametrize(
    ("table", "happens", "fault"),
    [
        ("sample_age", {"quality": Quality.LOST}, Fault.NO_REPLY),
        ("sample_age", {"quality": Quality.REPEATED}, Fault.STALE),
        ("plausibility", {"position_m": 1.0}, Fault.IMPLAUSIBLE),
        ("heartbeat", {}, Fault.DCS_SILENT),
    ],
)
@pytest.mark.parametrize(("action", "command_pa"), [("vent", 0.0), ("safe", 9e3), (None, 420e3)])
def test_what_the_safety_table_watches_has_its_action_here(
    table: str, happens: dict[str, object], fault: Fault, action: str | None, command_pa: float
) -> None:
    safety = {"action": "fill", "heartbeat_action": "fill", "heartbeat_timeout_s": 0.3, "safe_pressure_pa": 9e3}
    own = {} if action is None else {table: {"action": action}}
    bench = automatic(safety=safety, supervision=own)
    found = [bench.step(**happens) for _ in range(40)]
    assert (found[-1].fault, found[-1].command_pa) == (fault, command_pa)


@pytest.mark.parametrize("table", ["plausibility", "heartbeat"])
def test_a_bad_sensor_and_a_silent_dcs_may_be_met_by_hand(table: str) -> None:
    bench = automatic(safety={"heartbeat_timeout_s": 0.3}, supervision={table: {"action": "manual"}})
    bench.ask(reference_m=0.05)
    before_pa = bench.step().command_pa
    sample: dict[str, object] = {"position_m": 1.0} if table == "plausibility" else {}
    found = [bench.step(**sample) for _ in range(40)][-1]
    assert (found.mode, found.command_pa) == (Mode.MANUAL, before_pa)
    bench.ask(manual_pa=33e3)
    assert bench.step(**sample).command_pa == 33e3


def test_a_device_that_does_not_answer_cannot_be_met_by_hand() -> None:
    with pytest.raises(InputError, match=r"supervision\.sample_age\.action"):
        validate(
            DaemonFile,
            {"valve": {"stroke_m": 0.1}, "supervision": {"sample_age": {"action": "manual"}}},
            "d.toml",
        )


@pytest.mark.parametrize("maximum_pa", [420e3, 4.2e6])
@pytest.mark.parametrize(("shown_pa", "frozen"), [(71e3, False), (250e3, True)])
def test_what_is_measured_is_the_actuators_by_what_the_valve_needs_however_far_the_limits_are(
    maximum_pa: float, shown_pa: float, *, frozen: bool
) -> None:
    """The command falls under what holds the stem. Its own pressure has not followed yet; the supply's never does."""
    table = {"valve": {"stroke_m": STROKE_M}, "pressure": {"maximum_pa": maximum_pa}}
    settings = MonitorSettings.of(DaemonFile.model_validate(table))
    band = RestBand(Ratios(-7.9e5, -2.4e4), (), None, beyond_pa=1.2e4, off_pa=1.6e3)
    memory = MonitorMemory()
    for cycle in range(round(20 * UNKNOWN_S)):
        memory = after_cycle(
            memory,
            settings,
            now_s=0.1 * cycle,
            position_m=0.09,
            command_pa=71e3 if cycle < 2 else 1e4,
            pressure_pa=shown_pa,
            reference_m=None,
            faulty=False,
            needs=lambda _band: needs_of(by_law=True, band=band, allowed_pa=0.0, answers_s=0.1),
        )
    assert (Fault.FROZEN_SENSOR in memory.holding) is frozen

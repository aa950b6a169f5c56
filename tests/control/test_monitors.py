"""The monitors of table `[supervision]`: what each finds, after which delay, what it ends in; on a scripted stem."""

from collections.abc import Callable

import pytest

from config.codes import Fault, Mode, Quality
from config.daemon_file import DaemonFile
from config.errors import InputError
from config.loading import validated
from positioner.control.controller_memory import Decision
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
    bench.step()
    return bench.step()


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


MONITORS: dict[str, tuple[Finds, Fault, float]] = {
    "travel_deviation": (deviates, Fault.TRAVEL_DEVIATION, 0.1),
    "frozen_sensor": (is_frozen, Fault.FROZEN_SENSOR, 0.5),
    "position_rate": (jumps, Fault.POSITION_RATE, 10.0),
    "saturation": (is_saturated, Fault.SATURATED, 0.01),
    "overrun": (is_late, Fault.OVERRUN, 3.0),
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


@pytest.mark.parametrize("name", [each for each in MONITORS if each not in ("position_rate", "overrun")])
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


def test_by_default_a_sensor_that_stands_still_is_a_fault_and_a_slow_cycle_an_alarm() -> None:
    bench = automatic(cycle={"period_s": 0.01})
    is_frozen(bench)
    decisions = [bench.step() for _ in range(120)]
    assert decisions[-1].fault is Fault.FROZEN_SENSOR
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
        validated(DaemonFile, {"valve": {"stroke_m": STROKE_M}, "law": LAW, "safety": safety}, "daemon.toml")

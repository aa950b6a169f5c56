"""Alarms: the states of ISA-18.2, what is raised and when, the promise about false ones, and what clients may do."""

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import product
from math import inf, log, nan
from pathlib import Path

import numpy as np
import pytest
from pymodbus.constants import ExcCodes

from config.alarm_advice import ADVICE
from config.alarm_table import CLASSED, AlarmsTable
from config.codes import AlarmState, EventKind, ExperimentState, Mode, Ne107Cause, Ne107Status, ValveTestVerdict
from config.daemon_file import DaemonFile, HealthTable
from config.errors import InputError
from config.loading import validate
from fieldbus.modbus.function_codes import RegisterError
from fieldbus.modbus.server import RegisterServer
from positioner.cli.main import main
from positioner.daemon.alarms.alarm_list import AlarmList
from positioner.daemon.alarms.alarm_states import Alarm
from positioner.daemon.health import Health, HealthKeeper, StoredHealth
from positioner.daemon.health.e_detector import SECONDS_A_YEAR, EDetector, of_a_mean, of_a_share
from positioner.daemon.health.friction_alarms import HOUR_S, FoundFriction, FrictionAlarms, FrictionLimits
from positioner.daemon.health.position_limits import PositionLimits
from positioner.daemon.health.valve_health import HealthSettings
from positioner.history.kept_tests import last_tested_s
from positioner.tests_on_the_valve.kept_records import keep
from positioner.tests_on_the_valve.outcome import Outcome
from tests.daemon.health.test_valve_health import LAW, Panel, in_automatic

NORMAL, NEW, SEEN, RETURNED, SHELVED = AlarmState
HIGH = Ne107Cause.HIGH


def alarm_list() -> tuple[AlarmList, list[tuple[EventKind, Ne107Cause]], Callable[[float], None]]:
    told: list[tuple[EventKind, Ne107Cause]] = []
    now = [1e9]

    def pass_time(seconds: float) -> None:
        now[0] += seconds

    return AlarmList(lambda kind, _, cause: told.append((kind, cause)), now_s=lambda: now[0]), told, pass_time


def test_an_alarm_goes_through_the_states_of_isa_18_2_and_each_step_is_journaled() -> None:
    alarms, told, pass_time = alarm_list()
    state: Callable[[], AlarmState] = lambda: alarms.alarms[HIGH].state  # noqa: E731
    seen = [state()]
    steps: tuple[Callable[[], None], ...] = (
        lambda: alarms.look({HIGH}),
        lambda: alarms.acknowledge(HIGH),
        lambda: alarms.look(()),
        lambda: alarms.look({HIGH}),
        lambda: alarms.look(()),
        lambda: alarms.acknowledge(HIGH),
        lambda: alarms.look({HIGH}),
        lambda: alarms.shelve(HIGH, 60.0),
        lambda: pass_time(59.0),
        lambda: alarms.look({HIGH}),
        lambda: pass_time(2.0),
        lambda: alarms.look({HIGH}),
    )
    for step in steps:
        step()
        seen.append(state())
    assert seen == [NORMAL, NEW, SEEN, NORMAL, NEW, RETURNED, NORMAL, NEW, SHELVED, SHELVED, SHELVED, SHELVED, NEW]
    assert [kind.name.removeprefix("ALARM_") for kind, cause in told if cause is HIGH] == [
        "RAISED", "ACKNOWLEDGED", "RETURNED", "RAISED", "RETURNED", "ACKNOWLEDGED", "RAISED", "SHELVED", "UNSHELVED",
    ]  # fmt: skip


def test_whatever_happens_a_shelved_alarm_comes_back_unseen_and_one_that_holds_is_never_normal() -> None:
    steps: list[Callable[[Alarm, float], Alarm]] = [
        lambda it, now_s: it.after(now_s, holds=True),
        lambda it, now_s: it.after(now_s, holds=False),
        lambda it, _: it.acknowledge(),
        lambda it, now_s: it.shelved(now_s + 2.5),
    ]
    for course in product(steps, repeat=6):
        alarm = Alarm()
        for now_s, step in enumerate(course):
            before, alarm = alarm, step(alarm, float(now_s))
            assert (alarm.state is NORMAL) <= (not alarm.holds)
            if before.state is SHELVED and alarm.state is not SHELVED:
                assert alarm.state is (NEW if alarm.holds else NORMAL)


def test_a_limit_has_a_delay_and_a_dead_band() -> None:
    limits = PositionLimits.of(AlarmsTable.model_validate({"high": {"threshold": 0.9, "delay_s": 3.0}}))
    raised = []
    for now_s, opening in enumerate([0.95, 0.95, 0.8, 0.95, nan, 0.95, 0.95, 0.895, 0.91, 0.885, 0.895]):
        limits = limits.after(float(now_s), opening)
        raised.append(bool(limits.raised))
    assert raised == [False] * 6 + [True, True, True, False, False]


def test_an_e_value_has_a_mean_of_at_most_one_while_all_is_well() -> None:
    for at_most, chance in ((0.5, 0.5), (0.5, 0.2), (0.1, 0.1)):
        for bet in (0.6, 0.9, 0.99):
            bad, good = (np.exp(of_a_share(*each, at_most, [bet]))[0] for each in ((1, 0), (0, 1)))
            assert chance * bad + (1 - chance) * good <= 1.0 + 1e-12
    noise = np.random.default_rng(0).standard_normal(200_000)
    for bet in (0.5, 1.0, 2.0):
        assert np.mean(np.exp([bet * each - 0.5 * bet**2 for each in noise])) == pytest.approx(1.0, abs=0.15)
    assert of_a_mean(2.0, 0.5, [1.0]) == [3.5]


def test_false_alarms_are_no_more_than_promised_by_count() -> None:
    """At the very limit, where the promise is tight: 40 000 valve-years, one look a month, promise 30 years."""
    rng = np.random.default_rng(7)
    month_s, years, alarms = SECONDS_A_YEAR / 12, 0.0, 0
    test = EDetector(30.0, 2)
    for z in rng.standard_normal(12 * 40_000):
        alarms += test.enter(of_a_mean(z, 1.0, (0.5, 1.0)), month_s)
        years += 1 / 12
    assert 0 < alarms <= 1.15 * years / 30.0


def packing(**limits: float) -> FrictionAlarms:
    defaults = {"friction_high": 1.5, "friction_low": 0.5, "stiction_limit": 0.5, "false_alarm_years": 100.0}
    return FrictionAlarms(FrictionLimits(**{**defaults, **limits}))


@pytest.mark.parametrize(
    ("ratio", "deviation", "raised"),
    [
        (1.9, 0.02, {Ne107Cause.FRICTION_HIGH}),
        (1.51, 0.02, set()),
        (1.9, 0.5, set()),
        (1.49, 0.001, set()),
        (0.3, 0.02, {Ne107Cause.FRICTION_LOW}),
        (0.49, 0.02, set()),
    ],
)
def test_one_identification_raises_what_is_sure(ratio: float, deviation: float, raised: set[Ne107Cause]) -> None:
    assert packing().look(0.0, FoundFriction(ratio, deviation), 1.0, (0, 0), 0.0) == raised


def test_what_is_unsure_is_raised_by_many_and_over_with_the_next_that_is_well() -> None:
    tests, now_s, raised, count = packing(), 0.0, frozenset[Ne107Cause](), 0
    rng = np.random.default_rng(3)
    while not raised:
        now_s += 30 * 86400.0
        count += 1
        raised = tests.look(now_s, FoundFriction(1.7 + 0.1 * rng.standard_normal(), 0.1), 1.0, (0, 0), 0.0)
    assert 1 < count < 12
    assert tests.look(now_s + 1.0, None, 1.0, (0, 0), 0.0) == raised
    assert tests.look(now_s + 2.0, None, 1.7, (0, 0), 0.0) == set(), "a new baseline"
    assert tests.look(now_s + HOUR_S, FoundFriction(5.0, 0.1), 1.7, (0, 0), 0.0)
    assert tests.look(now_s + 2.0 * HOUR_S, FoundFriction(1.0, 0.1), 1.7, (0, 0), 0.0) == set()


def test_a_stem_that_misses_all_moves_is_told_and_one_that_misses_the_share_allowed_is_not() -> None:
    for missing, told in ((1.0, True), (0.5, False)):
        tests, rng, missed, raised = packing(), np.random.default_rng(5), 0, frozenset[Ne107Cause]()
        for asked in range(1, 60):
            missed += rng.random() < missing
            raised |= tests.look(60.0 * asked, None, nan, (asked, missed), missed / asked)
        assert (Ne107Cause.STICTION in raised) == told


def test_a_model_that_has_changed_and_a_test_that_is_overdue_are_told() -> None:
    panel, sample, decision = in_automatic()
    alarms = AlarmsTable(test_interval_days=30.0)
    health = Health(HealthSettings.of(HealthTable(), 0.1016, alarms=alarms))
    applied = decision.applied
    assert applied.ratios is not None
    found = decision._replace(applied=type(applied)(applied.ratios, 1))
    health.look(sample, found, 0.0)
    health.look(sample, found, 29 * 86400.0)
    assert health.conditions == set()
    softer = type(applied.ratios)(0.7 * applied.ratios.b_over_c, applied.ratios.k_over_c)
    health.look(sample, found._replace(applied=type(applied)(softer, 2)), 31 * 86400.0)
    assert health.conditions == {Ne107Cause.MODEL_CHANGED, Ne107Cause.TEST_OVERDUE}
    assert panel.get("alarms_active") == 0.0


def test_a_limit_that_is_passed_at_a_restart_stays_raised_for_its_delay() -> None:
    """Else an alarm that somebody has acknowledged or shelved would return, and be raised anew."""
    _, sample, decision = in_automatic()
    alarms = AlarmsTable.model_validate({"high": {"threshold": 0.6, "delay_s": 30.0}})
    before, after = (Health(HealthSettings.of(HealthTable(), 0.1016, alarms=alarms)) for _ in range(2))

    def looked(health: Health, opening: float, now_s: float) -> set[Ne107Cause]:
        health.look(sample._replace(position_m=opening * 0.1016, now_s=now_s), decision, now_s)
        return set(health.conditions)

    assert looked(before, 0.7, 0.0) == set()
    assert looked(before, 0.7, 30.0) == {HIGH}
    after.watch.begin(before.watch.kept)
    assert looked(after, 0.7, 0.0) == {HIGH}
    assert looked(after, 0.5, 1.0) == set()


DAY_S = 86_400.0


def test_a_test_is_due_since_the_last_one_played_here_or_kept_by_a_command_of_its_own(tmp_path: Path) -> None:
    _, sample, decision = in_automatic()
    health = Health(HealthSettings.of(HealthTable(), 0.1016, alarms=AlarmsTable(test_interval_days=30.0)))

    def overdue(day: float, state: ExperimentState = ExperimentState.NONE) -> bool:
        played = replace(decision.experiment, state=state)
        health.look(sample, decision._replace(experiment=played), day * DAY_S)
        return Ne107Cause.TEST_OVERDUE in health.conditions

    for day, verdict in ((5.0, ValveTestVerdict.FRICTION_HIGH), (20.0, ValveTestVerdict.BROKEN_OFF)):
        keep(tmp_path, Outcome("step test", "FV-1", (), (verdict,)), "", day * DAY_S, {})
    (tmp_path / "20990101T000000_torn.json").write_text("{")
    health.watch.tested(last_tested_s(tmp_path))
    assert [overdue(day) for day in (34.0, 36.0)] == [False, True], "since day 5: broken off is no test"
    assert not overdue(36.0, ExperimentState.TURNED), "a partial stroke turns at its travel"
    assert [overdue(day) for day in (65.0, 67.0)] == [False, True]
    assert last_tested_s(tmp_path / "nowhere") is None


def test_the_dcs_reads_acknowledges_and_shelves(tmp_path: Path) -> None:
    panel = Panel(LAW, travel_limit_strokes=0.1)
    stored = StoredHealth.in_folder(tmp_path, "FV-1", {})
    keeper = HealthKeeper(panel.health, lambda: panel.cycle.snapshot, "FV-1", stored, alarms=panel.alarms)
    panel.set("mode", Mode.AUTOMATIC)
    panel.run(0.01)
    bit = float(1 << (Ne107Cause.TRAVEL - 1))
    panel.set("reference", 0.8)
    panel.run(0.5)
    keeper.check()
    assert (panel.get("alarms_active"), panel.get("alarms_unacknowledged")) == (bit, bit)
    panel.set("alarm_acknowledge", Ne107Cause.TRAVEL)
    assert (panel.get("alarms_active"), panel.get("alarms_unacknowledged")) == (bit, 0.0)
    panel.set_all({"alarm_shelve": Ne107Cause.TRAVEL, "alarm_shelve_time": 600.0})
    assert (panel.get("alarms_active"), panel.get("alarms_shelved")) == (0.0, bit)
    assert panel.get("ne107_cause") == Ne107Cause.TRAVEL, "NE 107 says what is so, shelved or not"
    keeper.stop()
    again = AlarmList()
    kept = StoredHealth.in_folder(tmp_path, "FV-1", {})
    HealthKeeper(Health.idle(0.1), lambda: panel.cycle.snapshot, "FV-1", kept, alarms=again)
    assert again.alarms[Ne107Cause.TRAVEL].state is SHELVED, "over a restart"


@pytest.mark.parametrize(
    "values",
    [
        {"alarm_acknowledge": Ne107Cause.EXCITED},
        {"alarm_acknowledge": 31.0},
        {"alarm_shelve": Ne107Cause.TRAVEL},
        {"alarm_shelve": Ne107Cause.TRAVEL, "alarm_shelve_time": 1e6},
    ],
)
def test_what_cannot_be_done_to_an_alarm_is_refused(values: dict[str, float]) -> None:
    panel = Panel(LAW)
    with pytest.raises(RegisterError) as refused:
        panel.set_all(values)
    assert refused.value.code is ExcCodes.ILLEGAL_VALUE


def test_a_file_that_was_kept_wrongly_is_put_aside(tmp_path: Path) -> None:
    stored = StoredHealth.in_folder(tmp_path, "FV-1", {})
    content = json.loads(stored.path.read_text())
    content["more"]["alarms"] = {"NOTHING": {}}
    stored.path.write_text(json.dumps(content))
    problem = StoredHealth.in_folder(tmp_path, "FV-1", {}).kept.problem
    assert problem is not None
    assert problem.startswith("more.alarms")


def test_each_alarm_has_advice_and_a_class_that_the_file_may_change() -> None:
    assert set(CLASSED.values()) - set(ADVICE) == {
        Ne107Cause.NOT_AUTOMATIC,
        Ne107Cause.EXCITED,
        Ne107Cause.NOT_IDENTIFIED,
    }
    assert all(text.endswith((".", "?")) for text in ADVICE.values())
    settings = HealthSettings.of(HealthTable(), 0.1, alarms=AlarmsTable.model_validate({"ne107": {"stuck": "F"}}))
    assert settings.cause_classes == {Ne107Cause.STUCK: Ne107Status.FAILURE}
    with pytest.raises(InputError, match=r"^site\.toml: alarms\.ne107: fault: unknown cause; allowed here: "):
        validate(DaemonFile, {"valve": {"stroke_m": 0.1}, "alarms": {"ne107": {"fault": "M"}}}, "site.toml")


def test_evidence_never_overflows() -> None:
    test = EDetector(inf, 1)
    for _ in range(100):
        assert not test.enter([log(1e30)], 1.0)


def test_the_command_lists_in_words_acknowledges_and_shelves(capsys: pytest.CaptureFixture[str]) -> None:
    panel = Panel(LAW)
    server = RegisterServer(panel.registers, "127.0.0.1", 0, 1)
    server.start()
    where = ["--port", str(server.port)]
    try:
        assert main(["alarms", *where]) == 0
        assert capsys.readouterr().out == "no alarms\n"
        panel.alarms.look({Ne107Cause.FRICTION_HIGH, Ne107Cause.STICTION})
        assert main(["alarms", *where]) == 1
        first, advice, *_ = capsys.readouterr().out.splitlines()
        assert first.split(None, 1) == [
            "friction_high",
            f"{NEW.text:36} {Ne107Cause.FRICTION_HIGH.text}",
        ]
        assert advice.strip() == ADVICE[Ne107Cause.FRICTION_HIGH]
        assert main(["alarms", "--shelve", "stiction", "--minutes", "5", *where]) == 1
        assert main(["alarms", "--acknowledge", "all", "--json", *where]) == 0
        said = json.loads(capsys.readouterr().out.splitlines()[-1])
        assert {name: each["state"] for name, each in said.items()} == {
            "friction_high": SEEN.text,
            "stiction": SHELVED.text,
        }
        assert main(["alarms", "--acknowledge", "friction", *where]) == 2
        assert capsys.readouterr().err.startswith(
            "positioner alarms: friction: no alarm of that name; allowed: fault, "
        )
        assert main(["alarms", "--shelve", "stiction", "--minutes", "9999", *where]) == 1
        assert (
            "alarm_shelve_time = 599940 was refused: allowed is up to [alarms] shelve_limit_s"
            in capsys.readouterr().err
        )
    finally:
        server.stop()

"""What the daemon writes into its history: on a virtual valve, turn by turn; the thread and the process at the end."""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from config.codes import EventKind, Fault, Mode, Ne107Cause, Ne107Status, Quality, Refusal
from config.daemon_file import DaemonFile
from config.record_tables import HistoryTable
from positioner.control.controller_memory import Decision
from positioner.daemon.health import HealthRecord, HealthSettings
from positioner.daemon.history import HistoryKeeper, history_keeper
from positioner.daemon.history.decision_events import Happened, events_between
from positioner.daemon.history.health_hours import HealthLook
from positioner.history import HistoryReader
from positioner.history.entries import ConfigurationChange, Event, HealthHour, Identification, Write
from tests.control.test_controller import Bench, automatic
from tests.daemon.panel import Panel, refused
from tests.history.test_history_file import full_above
from tests.waiting import until

FILE = DaemonFile.model_validate({"valve": {"name": "FV 1", "stroke_m": 0.1016}})
CLASSES = HealthSettings.of(FILE.health, 0.1016, FILE.supervision).fault_classes
TABLE = HistoryTable(folder="history")
PEER = "127.0.0.1:40000"


class Site:
    """A keeper without its thread, and the registers of one virtual valve."""

    def __init__(self, folder: Path, table: HistoryTable | None = TABLE, file: DaemonFile = FILE) -> None:
        self.keeper = HistoryKeeper(table, folder)
        self.valve = self.keeper.valve(file, CLASSES)
        self.panel = Panel()
        self.panel.cycle.history = self.valve
        self.folder = folder / "history"

    def turn(self) -> None:
        self.panel.run()
        self.keeper.turn()
        self.panel.run()

    def events(self, *names: str) -> list[Event]:
        with HistoryReader(self.folder) as history:
            return [each for each in history.events() if not names or each.name in names]

    def writes(self) -> list[Write]:
        with HistoryReader(self.folder) as history:
            return [row for _, row in history.rows(Write)]


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Site]:
    site = Site(tmp_path)
    site.turn()
    yield site
    site.keeper.stop("the test's end")


# ---- which events there are


def classified(before: Decision, after: Decision) -> list[tuple[str, Ne107Status, int]]:
    return [(each.kind.name, each.ne107, each.cause) for each in events_between(before, after, CLASSES)]


def test_a_fault_is_one_event_and_what_it_does_to_the_mode_another() -> None:
    bench = automatic()
    before = bench.step()
    for _ in range(3):
        after = bench.step(quality=Quality.LOST)
    assert classified(before, after) == [
        ("FAULT", Ne107Status.FAILURE, Fault.NO_REPLY),
        ("MODE", Ne107Status.FUNCTION_CHECK, Mode.HOLD),
    ]
    bench.acknowledge()
    bench.step()
    assert classified(after, bench.step()) == [("FAULT_GONE", Ne107Status.GOOD, Fault.NO_REPLY)]


def test_an_alarm_has_the_class_that_the_file_gives_its_monitor() -> None:
    before = Bench().step()
    after = before._replace(alarms=(Fault.OVERRUN,))
    assert classified(before, after) == [("ALARM", Ne107Status.OUT_OF_SPECIFICATION, Fault.OVERRUN)]
    assert classified(after, before) == [("ALARM_GONE", Ne107Status.GOOD, Fault.OVERRUN)]


def test_an_excitation_begins_ends_and_is_refused() -> None:
    bench = automatic()
    before = bench.step()
    bench.ask(eta=(0, 0, 0))
    excited = bench.step()
    assert classified(before, excited) == [("EXCITED", Ne107Status.FUNCTION_CHECK, 0)]
    bench.ask(eta=(1, 1, 1))
    after = bench.step()
    assert classified(excited, after)[0] == ("EXCITATION_ENDED", Ne107Status.GOOD, after.inhibit_reason)
    refused_one = replace(before.applied, refusals=1, last_refusal=Refusal.NOISE_DOMINATES)
    assert classified(before, before._replace(applied=refused_one)) == [
        ("NOT_IDENTIFIED", Ne107Status.GOOD, Refusal.NOISE_DOMINATES)
    ]


def test_moves_are_no_events() -> None:
    bench = automatic()
    before = bench.step()
    bench.ask(reference_m=0.08)
    assert classified(before, bench.step()) == []


# ---- served and kept


def test_the_newest_event_is_served_with_its_number_and_kept(site: Site) -> None:
    site.panel.set("mode", Mode.AUTOMATIC)
    site.turn()
    got = {name: site.panel.get(name) for name in ("event_number", "event", "event_class", "event_cause")}
    assert got == {"event_number": 2, "event": EventKind.MODE, "event_class": 0, "event_cause": Mode.AUTOMATIC}
    assert abs(site.panel.get("event_time") - time.time()) < 60
    newest = site.events()[-1]
    assert (newest.number, newest.name, newest.text) == (2, "MODE", "automatic")


def test_without_a_folder_events_are_served_and_nothing_is_kept(tmp_path: Path) -> None:
    site = Site(tmp_path, None)
    site.turn()
    assert site.panel.get("event_number") == 1
    site.keeper.session(PEER, "connected", "")
    site.keeper.stop("the end")
    assert list(tmp_path.iterdir()) == []


def test_numbers_go_on_over_a_restart_and_a_kill_is_told(tmp_path: Path) -> None:
    Site(tmp_path).keeper.stop("Terminated")
    killed = Site(tmp_path)
    killed.keeper.turn()
    killed.keeper.file.close()  # type: ignore[union-attr]  # as the system does for a process that is killed
    site = Site(tmp_path)
    site.keeper.turn()
    said = [(each.number, each.name, each.text.partition(";")[2]) for each in site.events()]
    unseen = " nothing says how it ended before: killed, or without power"
    assert said == [(1, "STARTED", ""), (2, "STOPPED", ""), (3, "STARTED", ""), (4, "STARTED", unseen)]
    site.keeper.stop("the end")


def test_a_changed_configuration_is_told_key_by_key(tmp_path: Path) -> None:
    Site(tmp_path).keeper.stop("Terminated")
    Site(tmp_path).keeper.stop("Terminated")
    tables = {"valve": {"name": "FV 1", "stroke_m": 0.2}, "cycle": {"period_s": 0.01}}
    site = Site(tmp_path, file=DaemonFile.model_validate(tables))
    site.keeper.turn()
    (changed,) = site.events("CONFIGURATION")
    assert changed.text == "cycle.period_s was 0.001, is 0.01; valve.stroke_m was 0.1016, is 0.2"
    with HistoryReader(site.folder) as history:
        rows = [(row.key, row.was, row.now) for _, row in history.rows(ConfigurationChange)]
    assert rows == [("cycle.period_s", "0.001", "0.01"), ("valve.stroke_m", "0.1016", "0.2")]
    site.keeper.stop("the end")


def test_an_identification_is_kept_with_its_deviations(site: Site) -> None:
    before = Bench().step()
    applied = replace(before.applied, count=1, last_refusal=Refusal.VALID)
    site.valve.enter(before, before._replace(applied=applied))
    site.turn()
    assert [each.name for each in site.events("IDENTIFIED")] == ["IDENTIFIED"]
    with HistoryReader(site.folder) as history:
        ((_, row),) = history.rows(Identification)
    assert (row.applied, row.reason) == (1, "valid")
    assert (row.b_over_c_applied, row.k_over_c_applied) == (-800e3, -20e3)
    assert abs(row.time_s - time.time()) < 60


def test_an_hour_keeps_the_worst_class_and_the_counts_of_its_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    looks = [Ne107Status.GOOD, Ne107Status.FAILURE, Ne107Status.GOOD]
    record = HealthRecord()
    monkeypatch.setattr(history_keeper, "HEALTH_EVERY_S", 0.0)
    site = Site(tmp_path)
    site.valve.look = lambda: HealthLook(looks.pop(0), record, 20e3, 10, 1, 2, 3, 4)
    for _ in range(3):
        site.keeper.turn()
    with HistoryReader(site.folder) as history:
        rows = [row for _, row in history.rows(HealthHour)]
    assert rows[-1].ne107_worst == Ne107Status.FAILURE
    assert (rows[-1].friction_pa, rows[-1].cycles, rows[-1].hour_s % 3600) == (20e3, 10, 0)
    site.valve.look = None


# ---- the audit


def test_every_write_is_kept_with_its_peer_and_a_refused_one_with_its_reason(site: Site) -> None:
    site.panel.set("reference", 0.25)
    refused(site.panel, "reference", 1.5)
    site.valve.wrote("dcs (operator) at 10.0.0.1:502", {"reference": 0.5, "heartbeat": 7})
    site.turn()
    said = [(row.what, row.peer, row.who, row.role, row.text) for row in site.writes()]
    assert said == [
        ("write", "test", "", "", "reference = 0.25"),
        ("refused", "test", "", "", "reference: allowed is 0 to 1 p.u., got 1.5"),
        ("write", "10.0.0.1:502", "dcs", "operator", "reference = 0.5, heartbeat"),
    ]


def test_a_name_that_pretends_to_be_another_is_the_name(site: Site) -> None:
    site.valve.wrote("boss (engineer) at 9.9.9.9:1 (observer) at 10.0.0.1:502", {"heartbeat": 1})
    site.turn()
    (row,) = site.writes()
    assert (row.who, row.role, row.peer) == ("boss (engineer) at 9.9.9.9:1", "observer", "10.0.0.1:502")


def test_heartbeats_are_one_row_with_how_many_and_another_peer_or_write_is_another(site: Site) -> None:
    for beat in range(100):
        site.valve.wrote(PEER, {"heartbeat": beat})
        site.keeper.turn()
    site.valve.wrote("10.0.0.2:1", {"heartbeat": 1})
    site.valve.wrote(PEER, {"reference": 0.5})
    site.valve.wrote(PEER, {"reference": 0.6})
    site.turn()
    said = [(row.text, row.times) for row in site.writes()]
    assert said == [("heartbeat", 100), ("heartbeat", 1), ("reference = 0.5", 1), ("reference = 0.6", 1)]


def test_a_dcs_that_writes_the_same_reference_and_a_heartbeat_in_turn_costs_two_rows(site: Site) -> None:
    for beat in range(100):
        site.valve.wrote(PEER, {"reference": 0.5})
        site.valve.wrote(PEER, {"heartbeat": beat})
    site.keeper.stop("the end")
    assert [(row.text, row.times) for row in site.writes()] == [("reference = 0.5", 100), ("heartbeat", 100)]
    site.keeper = HistoryKeeper(None, site.folder)


def test_a_host_that_is_refused_without_end_costs_a_few_rows_and_all_are_counted(site: Site) -> None:
    for number in range(5000):
        site.valve.refused(f"10.0.0.9:{number}", f"{number}: nothing to write there")
    site.valve.wrote(PEER, {"reference": 0.5})
    site.turn()
    rows = site.writes()
    assert len(rows) < 150
    assert rows[-1].text == "reference = 0.5"


def test_sessions_are_kept(site: Site) -> None:
    site.keeper.session(PEER, "connected", "")
    site.keeper.session("eve (none) at 10.0.0.1:2", "refused", "function 16 needs the role operator")
    site.turn()
    said = [(row.valve, row.what, row.who, row.role) for row in site.writes()]
    assert said == [("", "connected", "", ""), ("", "refused", "eve", "none")]


# ---- what goes wrong


def test_a_full_disk_is_one_line_and_an_event_when_it_is_over_and_nothing_is_lost_before_it_must(
    site: Site, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(history_keeper, "RETRY_S", 0.0)
    with full_above(1):
        for number in range(20):
            site.panel.set("reference", number / 100)
            site.turn()
        assert site.panel.get("history_lost") == 0
    assert [record.message for record in caplog.records].count("the history cannot be written") == 1
    site.turn()
    site.turn()
    (gap,) = site.events("HISTORY_GAP")
    assert gap.text.startswith("could not be written from 20")
    assert gap.text.endswith(": 0 entries lost")
    assert len(site.writes()) == 20


def test_what_a_full_disk_costs_is_counted_and_told(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history_keeper, "RETRY_S", 0.0)
    monkeypatch.setattr(history_keeper, "MOST_PENDING", 10)
    with full_above(1):
        for number in range(25):
            site.panel.set("reference", number / 100)
            site.turn()
        assert site.panel.get("history_lost") == 15
    site.turn()
    site.turn()
    assert site.events("HISTORY_GAP")[0].text.endswith(": 15 entries lost")
    assert [row.text for row in site.writes()] == [f"reference = {number / 100:g}" for number in range(10)]


def test_more_than_there_is_room_for_is_counted_and_told(site: Site, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(history_keeper, "MOST_WAITING", 5)
    for number in range(9):
        site.valve.wrote(PEER, {"reference": number / 10})
    site.turn()
    assert site.panel.get("history_lost") == 4
    site.turn()
    assert site.events("HISTORY_GAP")[0].text == "4 entries were lost: more came at once than there was room for"
    assert len(site.writes()) == 5


def test_a_cycle_that_changes_without_end_is_bounded_and_counted(site: Site) -> None:
    one = Bench().step()
    other = one._replace(mode=Mode.MANUAL)
    for _ in range(2100):
        site.valve.enter(one, other)
    assert site.valve.changes_lost == 100
    site.turn()
    assert len(site.events("MODE")) == 2000


class SetClock:
    """The module time with the gateway's clock some seconds off."""

    def __init__(self, by_s: float) -> None:
        self.by_s = by_s

    def time(self) -> float:
        return time.time() + self.by_s

    def monotonic(self) -> float:
        return time.monotonic()


@pytest.mark.parametrize("by_s", [-86_400.0, 3600.0])
def test_a_clock_that_is_set_is_an_event_and_numbers_keep_the_order(
    site: Site, monkeypatch: pytest.MonkeyPatch, by_s: float
) -> None:
    monkeypatch.setattr(history_keeper, "time", SetClock(by_s))
    site.panel.set("mode", Mode.MANUAL)
    site.turn()
    set_, mode = site.events()[-2:]
    assert (set_.name, set_.text, mode.name) == ("CLOCK_SET", f"by {by_s:+.1f} s", "MODE")
    assert mode.number == set_.number + 1
    assert mode.time_s == pytest.approx(time.time() + by_s, abs=60)


def test_a_clock_behind_the_history_at_the_start_is_an_event(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Site(tmp_path).keeper.stop("Terminated")
    monkeypatch.setattr(history_keeper, "time", SetClock(-86_400.0))
    site = Site(tmp_path)
    site.keeper.turn()
    (set_,) = site.events("CLOCK_SET")
    assert float(set_.text.split()[1]) == pytest.approx(-86_400, abs=60)
    site.keeper.stop("the end")


def test_a_file_that_was_set_aside_is_an_event(tmp_path: Path) -> None:
    first = Site(tmp_path)
    first.keeper.stop("Terminated")
    path = first.folder / "history.sqlite"
    content = bytearray(path.read_bytes())
    content[4096:8192] = b"x" * 4096
    path.write_bytes(content)
    site = Site(tmp_path)
    site.keeper.turn()
    assert "it is history.sqlite.unreadable now" in site.events("HISTORY_ANEW")[0].text
    site.keeper.stop("the end")


def test_a_thread_that_dies_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What `Endings` listens to, and ends the daemon by."""
    died: list[str] = []
    monkeypatch.setattr(threading, "excepthook", lambda what: died.append(f"{what.thread.name}: {what.exc_value}"))
    monkeypatch.setattr(history_keeper, "WRITE_EVERY_S", 0.0)
    site = Site(tmp_path)
    site.valve.look = lambda: 1 / 0  # type: ignore[assignment]
    site.keeper.start()
    until(lambda: died != [], "the thread's end")
    assert died == ["history: division by zero"]
    site.valve.look = None
    site.keeper.stop("history died")
    assert site.events()[-1].text == "history died"


@pytest.mark.patient
def test_the_thread_writes_by_itself_and_the_end_waits_for_what_waits(tmp_path: Path) -> None:
    site = Site(tmp_path)
    site.keeper.start()
    end_s = time.monotonic() + 60
    site.valve.happened(Happened(EventKind.HEALTH, Ne107Status.FAILURE, Ne107Cause.FAULT))
    while site.valve.newest.kind != EventKind.HEALTH:
        assert time.monotonic() < end_s
        time.sleep(0.01)
    site.valve.wrote(PEER, {"reference": 0.5})
    site.keeper.stop("Terminated")
    assert [row.text for row in site.writes()] == ["reference = 0.5"]
    assert site.events()[-1].text == "Terminated"

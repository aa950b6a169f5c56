"""What is kept over a restart: whole or not at all, and never mended in silence."""

import json
import logging
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from config.errors import InputError
from positioner.cli.health import print_day
from positioner.daemon.health import Health, HealthKeeper, HealthRecord, StoredHealth
from positioner.daemon.health.daily_figures import DAY_S, OperationDay
from positioner.daemon.health.health_file import KeptAlarm, KeptHealth, KeptMore, kept_days, read_record, write_record
from positioner.daemon.health.valve_conditions import KeptConditions
from positioner.daemon.snapshot import Snapshot
from positioner.daemon.sole_daemon import HEALTH, valve_file_path
from tests.daemon.health.test_valve_health import Panel

KEPT = HealthRecord(12.5, 340, 0.25, 17, 22e3)
SCALES = {"device.map.command_pa.scale": "20.0", "device.map.command_pa.offset": "0.0"}


def test_what_was_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "valve.json"
    for record in (KEPT, HealthRecord()):
        write_record(path, "FV-1", record, SCALES)
        assert read_record(path, "FV-1", SCALES) == KeptHealth(record)
    assert [each.name for each in tmp_path.iterdir()] == ["valve.json"]


def test_without_a_file_everything_begins(tmp_path: Path) -> None:
    assert read_record(tmp_path / "none.json", "FV-1", SCALES) == KeptHealth()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"valve": "FV-2"}, "valve: allowed is 'FV-1', got 'FV-2'"),
        ({"version": 2}, "version: "),
        ({"travel_m": -1.0}, "travel_m: allowed is 0 to 1e+09, got -1.0"),
        ({"travel_m": "12"}, "travel_m: "),
        ({"travel_m": True}, "travel_m: "),
        ({"reversals": 3.5}, "reversals: "),
        ({"stiction_index": 1.5}, "stiction_index: "),
        ({"baseline_pa": 0}, "baseline_pa: allowed is 0.001 to 1e+12, got 0"),
        ({"travel_m": 1e300}, "travel_m: allowed is 0 to 1e+09, got 1e+300"),
        ({"travel_m": float("inf")}, "travel_m: "),
        ({"baseline_pa": 1e-300}, "baseline_pa: allowed is 0.001"),
        ({"moves_judged": 10**400}, "moves_judged: allowed is 0 to 4.29497e+09, got 1000"),
        ({"extra": 1}, "extra: unknown key"),
        ({"scales": {"a": 1}}, "scales.a: "),
    ],
)
def test_a_record_that_cannot_be_is_put_aside_and_told(tmp_path: Path, change: dict[str, object], said: str) -> None:
    path = tmp_path / "valve.json"
    write_record(path, "FV-1", KEPT, SCALES)
    spoilt = json.dumps(json.loads(path.read_text()) | change)
    path.write_text(spoilt)
    kept = read_record(path, "FV-1", SCALES)
    record, problem = kept.record, kept.problem
    assert record == HealthRecord()
    assert problem is not None
    assert problem.startswith(said)
    assert not path.exists()
    assert (tmp_path / "valve.json.unreadable").read_text() == spoilt
    path.write_text("{")
    assert "it is valve.json.unreadable2 now" in (read_record(path, "FV-1", SCALES).problem or "")
    assert (tmp_path / "valve.json.unreadable").read_text() == spoilt, "what was put aside before stays"


def test_a_baseline_of_another_scale_is_dropped_and_told_and_the_counts_stay(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = valve_file_path(tmp_path, "FV-1", HEALTH)
    write_record(path, "FV-1", KEPT, SCALES)
    stored = StoredHealth.in_folder(tmp_path, "FV-1", SCALES | {"device.map.command_pa.scale": "10.0"})
    assert stored.kept.record == replace(KEPT, baseline_pa=None)
    keeper = HealthKeeper(Health.idle(0.1), undecided, "FV-1", stored)
    with caplog.at_level(logging.WARNING):
        keeper.start()
        keeper.stop()
    assert [record.getMessage() for record in caplog.records] == ["friction baseline dropped"]
    again = StoredHealth.in_folder(tmp_path, "FV-1", stored.scales)
    assert (again.kept.record.travel_m, again.kept.rescaled) == (12.5, None), "the new scales stand in the file"


@pytest.mark.parametrize("added", ["device.map.pressure_pa.scale", "device.host"])
def test_what_is_new_in_the_configuration_drops_no_baseline(tmp_path: Path, added: str) -> None:
    path = tmp_path / "valve.json"
    write_record(path, "FV-1", KEPT, SCALES)
    assert read_record(path, "FV-1", SCALES | {added: "1.0"}) == KeptHealth(KEPT)


def test_a_file_of_before_scales_were_kept_is_read(tmp_path: Path) -> None:
    path = tmp_path / "valve.json"
    write_record(path, "FV-1", KEPT, SCALES)
    content = json.loads(path.read_text())
    del content["scales"]
    path.write_text(json.dumps(content))
    assert read_record(path, "FV-1", SCALES) == KeptHealth(KEPT)


@pytest.mark.parametrize("text", [b"", b"{", b"\xff\x00", b"[1]", b'{"travel_m": NaN}', b"[" * 100_000])
def test_garbage_is_put_aside_and_told_in_one_line(tmp_path: Path, text: bytes) -> None:
    path = tmp_path / "valve.json"
    path.write_bytes(text)
    kept = read_record(path, "FV-1", SCALES)
    record, problem = kept.record, kept.problem
    assert record == HealthRecord()
    assert problem is not None
    assert "\n" not in problem
    assert (tmp_path / "valve.json.unreadable").read_bytes() == text


def ways_into(content: object, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield the way to everything that a kept file holds; of a list the last."""
    table = content if isinstance(content, dict) else {-1: content[-1]} if isinstance(content, list) and content else {}
    for key, value in table.items():
        yield (*path, key)
        yield from ways_into(value, (*path, key))


def spoilt_at(content: Any, path: tuple[str | int, ...], value: object) -> str:
    copied = json.loads(json.dumps(content))
    inside = copied
    for key in path[:-1]:
        inside = inside[key]
    inside[path[-1]] = value
    return json.dumps(copied)


ODD = (float("nan"), 10**400, 1e308, "1", [1])


def test_whatever_stands_in_the_file_is_put_aside_or_gone_on_with_and_served(tmp_path: Path) -> None:
    """Each value, list and table of it is replaced by what it is not: a histogram with a bin less ended the daemon."""
    path, panel = valve_file_path(tmp_path, "FV-1", HEALTH), Panel()
    days = tuple(OperationDay(day=int(each // DAY_S)) for each in (1e9, time.time()))
    alarm = KeptAlarm(holds=True, acknowledged=False, since_s=1e9, shelved_until_s=0.0)
    conditions = KeptConditions(raised=("FRICTION_HIGH",), spring_pa_per_m=8e5, tested_s=1e9)
    write_record(
        path, "FV-1", KEPT, SCALES, KeptMore(conditions=conditions, days=days, alarms={"MODEL_CHANGED": alarm})
    )
    content = json.loads(path.read_text())
    for at in ways_into(content):
        for odd in ODD:
            path.write_text(spoilt_at(content, at, odd))
            panel.go_on_with(StoredHealth.in_folder(tmp_path, "FV-1", SCALES))
            assert read_record(path, "FV-1", SCALES).problem is None, (at, odd)
            for day in kept_days(path, "FV-1"):
                print_day(day)


def test_two_valves_whatever_their_names_have_a_file_each(tmp_path: Path) -> None:
    names = ["a/b", "a-b", "a b", "..", "é"]
    for name in names:
        StoredHealth.in_folder(tmp_path / "health", name, SCALES)
    assert len(list((tmp_path / "health").iterdir())) == len(names)


def test_a_folder_that_cannot_be_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="the health record cannot be kept there"):
        StoredHealth.in_folder(tmp_path / "file", "FV-1", SCALES)


def undecided() -> Snapshot:
    raise AssertionError("keeping needs no decision")


def test_the_keeper_tells_what_it_could_not_read_and_keeps_the_counts_at_the_end(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    StoredHealth.in_folder(tmp_path, "FV-1", SCALES)
    (file,) = tmp_path.iterdir()
    file.write_text("{")
    stored = StoredHealth.in_folder(tmp_path, "FV-1", SCALES)
    health = Health.idle(0.1)
    keeper = HealthKeeper(health, undecided, "FV-1", stored)
    with caplog.at_level(logging.WARNING):
        keeper.start()
        keeper.stop()
    assert [record.getMessage() for record in caplog.records] == ["health record unreadable, counts start anew"]
    restarted = Health(health.settings, KEPT)
    assert restarted.record == KEPT
    keeper = HealthKeeper(restarted, undecided, "FV-1", stored)
    keeper.store(HealthRecord(13.0, 341, 0.25, 17, 22e3))
    assert StoredHealth.in_folder(tmp_path, "FV-1", SCALES).kept.record.reversals == 341


def test_a_disk_that_fails_is_told_once_and_control_goes_on(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    stored = StoredHealth(tmp_path / "gone" / "valve.json", SCALES, KeptHealth())
    keeper = HealthKeeper(Health.idle(0.1), undecided, "FV-1", stored)
    with caplog.at_level(logging.ERROR):
        keeper.store(KEPT)
        keeper.store(KEPT)
    assert [record.getMessage() for record in caplog.records] == ["health record cannot be written"]

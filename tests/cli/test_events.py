"""`positioner events`: what a daemon's history says, while it runs and after it was killed."""

import json
import signal
from pathlib import Path

import pytest

from config.codes import EventKind, Mode
from config.registers import BY_NAME
from fieldbus.modbus.client_errors import Refused
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.dcs import Dcs
from positioner.history import HistoryReader
from positioner.history.entries import Write
from tests.children import child, ended, running
from tests.daemon_files import PATIENT, daemon_file, slave_file
from tests.history.test_history_file import altered, event, opened, write
from tests.waiting import until

REFERENCE = BY_NAME["reference"]
HISTORY = "[history]\nfolder = 'history'\n"


def printed(capsys: pytest.CaptureFixture[str], *words: str) -> list[str]:
    assert main(["events", *words]) == 0
    return capsys.readouterr().out.splitlines()


def test_events_are_lines_or_json_by_valve_time_and_number(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with opened(tmp_path) as file:
        file.append([event(1), event(2), event(1, "FV 2"), write(1)])
    folder = str(tmp_path)
    assert len(printed(capsys, folder)) == 3
    (line,) = printed(capsys, folder, "--valve", "FV 2")
    assert line.split() == [
        "2001-09-09T01:46:41.000Z",
        "1",
        "FV",
        "2",
        "good",
        "the",
        "mode",
        "has",
        "changed:",
        "automatic",
    ]
    (newest,) = printed(capsys, folder, "--valve", "FV 1", "--json", "--limit", "1")
    assert json.loads(newest)["number"] == 2
    assert len(printed(capsys, folder, "--since", "2001-09-09T01:46:42")) == 1
    assert printed(capsys, folder, "--since", "7d") == []
    assert printed(capsys, folder, "--table", "writes") == [
        "2001-09-09T01:46:40.000Z  FV 1  127.0.0.1:1  write reference = 0.5"
    ]


def test_a_valve_of_which_nothing_is_kept_is_not_one_where_nothing_has_happened(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with opened(tmp_path) as file:
        file.append([event(1), event(1, "FV 2")])
    assert main(["events", str(tmp_path), "--valve", "FV 3"]) == 2
    assert "--valve: no valve of that name; there are: FV 1, FV 2, got FV 3" in capsys.readouterr().err
    # The file's own valve is known, before anything has happened to it.
    (tmp_path / "empty").mkdir()
    with opened(tmp_path / "empty"):
        pass
    config = tmp_path / "daemon.toml"
    config.write_text("[valve]\nname = 'FV 9'\nstroke_m = 0.1\n[device]\nport = 5020\n[history]\nfolder = 'empty'\n")
    assert printed(capsys, str(config), "--valve", "FV 9") == []


def test_what_a_client_calls_itself_stays_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with opened(tmp_path) as file:
        file.append([write(1, "\x1b[2J\nforged line")])
    assert printed(capsys, str(tmp_path), "--table", "writes") == [
        "2001-09-09T01:46:40.000Z  FV 1  127.0.0.1:1  write ?[2J?forged line"
    ]


def test_without_a_history_it_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = daemon_file(tmp_path, 5020)
    assert main(["events", str(path)]) == 2
    assert capsys.readouterr().err == f"positioner events: {path}: has no table [history], so nothing is kept\n"
    assert main(["events", str(tmp_path / "history.sqlite")]) == 2
    assert capsys.readouterr().err.endswith("history.sqlite: cannot be read: No such file or directory\n")


@pytest.mark.real_time
def test_a_daemon_killed_while_it_is_written_to_keeps_what_was_there_and_numbers_go_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with running("sim", slave_file(tmp_path), "--listen-port", "0") as slave:
        path = daemon_file(tmp_path, port_in(slave), HISTORY, PATIENT)
        with child("run", path) as (daemon, ready), Dcs("127.0.0.1", port_in(ready)) as dcs:
            dcs.set("mode", Mode.MANUAL)
            with pytest.raises(Refused):
                dcs.client.write_registers(REFERENCE.address, REFERENCE.format.encode(1.5))
            until(lambda: dcs.get("event") == EventKind.MODE, "the event's register")
            number = dcs.get("event_number")
            until(lambda: len(writes(tmp_path)) >= 3, "the audit")
            assert len(printed(capsys, str(path))) == number, "readable while it runs"
            for beat in range(20):
                dcs.set("reference", beat / 100)
            daemon.kill()
        said = [row.what for row in writes(tmp_path)]
        assert said[:3] == ["connected", "write", "refused"]
        with child("run", path) as (daemon, ready), Dcs("127.0.0.1", port_in(ready)) as dcs:
            until(lambda: dcs.get("event_number") > number, "numbers that go on")
            daemon.signal(signal.SIGTERM)
            assert daemon.ended().status == 0
    lines = printed(capsys, str(path))
    assert any("nothing says how it ended before: killed" in line for line in lines)
    assert lines[-1].endswith("the daemon ended: Terminated")


def writes(folder: Path) -> list[Write]:
    with HistoryReader(folder / "history") as history:
        return [row for _, row in history.rows(Write)]


@pytest.mark.real_time
def test_two_daemons_with_one_history_are_refused_before_a_device_is_touched(tmp_path: Path) -> None:
    with running("sim", slave_file(tmp_path), "--listen-port", "0") as slave:
        path = daemon_file(tmp_path, port_in(slave), HISTORY, PATIENT)
        with running("run", path):
            other = path.with_name("other.toml")
            other.write_text(path.read_text())
            done = ended("run", other)
    assert done.status == 2
    assert "history: another daemon keeps its history there" in done.log


def test_a_daemon_with_a_history_of_an_older_version_does_not_start_and_leaves_it(tmp_path: Path) -> None:
    content = altered(tmp_path / "history", "PRAGMA user_version = 0")
    path = daemon_file(tmp_path, 5020, HISTORY)
    status, _, log = ended("run", path)
    assert status == 2
    (line,) = [each for each in log.splitlines() if "positioner run" in each]
    assert line.endswith("history.sqlite: is a history of version 0, allowed is 1; move it away")
    assert (tmp_path / "history" / "history.sqlite").read_bytes() == content

"""Processes that share a daemon's valves: one that dies, stands or cannot begin moves nothing, and harms no other.

What holds for any daemon of several valves, tests/daemon/test_fleet.py holds against three such processes.
"""

import json
import os
import signal
import sqlite3
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from config.codes import EventKind, Mode
from config.daemon_file import load_valves
from config.errors import InputError
from fieldbus.modbus.function_codes import RegisterError
from fieldbus.modbus.request_counts import RequestCounts
from positioner.cli.parts.children import port_in
from positioner.daemon import workers
from positioner.daemon.assembled_valves import Share
from positioner.daemon.history.audited_writes import Told
from positioner.daemon.workers import Workers
from positioner.dcs import Dcs, DcsError
from positioner.history import FILE_NAME
from tests.children import Child
from tests.daemon.test_fleet import device, registers_of, served, simulated_at
from tests.waiting import until

pytestmark = pytest.mark.real_time

STROKE_M = 0.1016


def file_of(folder: Path, ports: list[int], safety: str = 'action = "hold"', history: str = "") -> Path:
    path = folder / "shared.toml"
    path.write_text(
        "[service]\nprocesses = 2\n[cycle]\nperiod_s = 0.02\n[supervisory]\nport = 0\n"
        f"{history}[device]\nreply_timeout_s = 2.0\n[safety]\nstale_after_s = 60.0\n{safety}\n"
        + "".join(
            f"[[valve]]\nname = 'V{unit}'\nunit = {unit}\nstroke_m = {STROKE_M}\ndevice = {{ port = {port} }}\n"
            for unit, port in enumerate(ports, 1)
        )
    )
    return path


def said(path: Path, event: str) -> list[dict[str, object]]:
    lines = [json.loads(line) for line in path.with_suffix(".log").read_text().splitlines()]
    return [line for line in lines if line["event"] == event]


def pids_in(path: Path) -> dict[str, int]:
    """Return both workers' processes, by their valves."""
    until(lambda: len(said(path, "a worker is ready")) == 2, "both lines")
    return {str(line["valves"]): int(str(line["pid"])) for line in said(path, "a worker is ready")}


def is_gone(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return True
    return False


def rows(folder: Path, said: str) -> list[object]:
    """Return the only column that the history gives."""
    with closing(sqlite3.connect(folder / "history" / FILE_NAME)) as history:
        return [each for (each,) in history.execute(said)]


def answers(dcs: Dcs, name: str) -> float | None:
    """Return a value; None where the device behind the gateway does not respond."""
    try:
        return dcs.get(name)
    except DcsError as error:
        if "exception 11" not in str(error):
            raise
        return None


def test_one_that_is_killed_begins_anew_without_moving_anything_and_all_end_when_they_are_told(tmp_path: Path) -> None:
    simulated = [simulated_at(number) for number in (1, 2)]
    devices = [served(registers_of(each)) for each in simulated]
    safe = 'action = "safe"\nsafe_pressure_pa = 70e3'
    path = file_of(tmp_path, [each.port for each in devices], safe, "[history]\nfolder = 'history'\n")
    daemon = Child("run", path)
    try:
        port = port_in(daemon.line())
        pids = pids_in(path)
        with Dcs("127.0.0.1", port, unit=1) as first, Dcs("127.0.0.1", port, unit=2) as second:
            for dcs, pressure_pa in ((first, 9e3), (second, 17e3)):
                dcs.set_all({"mode": Mode.MANUAL, "manual_pressure": pressure_pa})
                until(lambda dcs=dcs, asked=pressure_pa: dcs.get("command") == asked, "the command")  # type: ignore[misc]
            assert first.get("requests_plain") < second.get("requests_plain"), "one count of all"
            until(lambda: bool(rows(tmp_path, "SELECT 1 FROM events WHERE valve = 'V1'")), "its start, written")
            os.kill(pids["V1"], signal.SIGKILL)
            until(lambda: answers(first, "mode") == Mode.HOLD, "the worker that was started again")
            assert first.get("command") == pytest.approx(9e3), "what the device had is held"
            assert (second.get("mode"), second.get("command")) == (Mode.MANUAL, 17e3)
            begun = first.get("cycles")
            until(lambda: first.get("cycles") > begun, "cycles")
        told_s = time.monotonic()
        daemon.signal(signal.SIGTERM)
        assert daemon.ended().status == 0
        assert time.monotonic() - told_s < 10.0
        assert [each.command_pa for each in simulated] == pytest.approx([70e3, 70e3]), "left in the safe state"
        assert all(is_gone(int(str(line["pid"]))) for line in said(path, "a worker is ready"))
        assert len(said(path, "stopped")) == 3, "each says how it ended"
        (ended,) = said(path, "a worker has ended")
        assert (ended["valves"], ended["reason"]) == ("V1", "status -9")
    finally:
        daemon.close()
        for each in devices:
            each.stop()
    begun, over = EventKind.STARTED, EventKind.STOPPED
    kinds = f"SELECT kind FROM events WHERE kind IN ({begun:d}, {over:d}) AND valve = "
    for valve, wanted in (("V1", [begun, begun, over]), ("V2", [begun, over])):
        assert rows(tmp_path, f"{kinds}'{valve}' ORDER BY number") == wanted
    writes = rows(tmp_path, "SELECT valve FROM writes WHERE what = 'write' ORDER BY number")
    assert writes == ["V1", "V1", "V2", "V2"], "numbered by one"
    assert rows(tmp_path, "SELECT number FROM writes WHERE what = 'connected'")


@pytest.fixture
def shared(tmp_path: Path) -> Iterator[tuple[Path, list[Share]]]:
    devices = [device(number) for number in (1, 2)]
    path = file_of(tmp_path, [each.port for each in devices])
    files = load_valves(path)
    yield path, Share(files, [None, None], path, is_whole=True).split(2)
    for each in devices:
        each.stop()


def position_m(here: Workers, unit: int) -> int | None:
    try:
        return here.registers[unit].read("input", 0, 1)[0]
    except RegisterError:
        return None


def test_one_whose_cycles_stand_is_killed_and_started_again(
    shared: tuple[Path, list[Share]], monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(workers, "STANDS_S", 1.0)
    monkeypatch.setattr(workers, "SLOWEST_CYCLES", 0.0)
    told: list[Told] = []
    with ExitStack() as on_exit:
        here = Workers(shared[1], RequestCounts(), told.append, on_exit)
        here.begin()
        first, second = here.workers

        def look(holds: Callable[[], bool]) -> Callable[[], bool]:
            def looked() -> bool:
                here.look(0.0)
                return holds()

            return looked

        until(look(lambda: first.turns > 0 and second.turns > 0), "turns")
        pid = first.process.pid if first.process else 0
        os.kill(pid, signal.SIGSTOP)
        caplog.clear()
        assert [position_m(here, 1), position_m(here, 1)] == [None, None], "no answer in time is exception 11"
        assert [each.message for each in caplog.records] == ["a worker answers late"], "said once, until it answers"
        until(look(lambda: is_gone(pid)), "the end of the one that stands")
        assert position_m(here, 1) is None
        assert position_m(here, 2) is not None, "the other answers"
        until(look(lambda: position_m(here, 1) is not None), "its return")
        assert first.process is not None
        monkeypatch.setattr(workers, "FIRST_S", 0.0)
        with monkeypatch.context() as full:
            full.setattr(tempfile, "TemporaryFile", Path(__file__, "no room").open)
            os.kill(first.process.pid, signal.SIGKILL)
            until(look(lambda: first.failures > 3), "starts that fail")
        until(look(lambda: position_m(here, 1) is not None), "its return once there is room")
        assert second.failures == 0


def test_without_the_daemon_they_end_as_they_are_told_to(tmp_path: Path) -> None:
    simulated = [simulated_at(number) for number in (1, 2)]
    devices = [served(registers_of(each)) for each in simulated]
    path = file_of(tmp_path, [each.port for each in devices], 'action = "safe"\nsafe_pressure_pa = 70e3')
    daemon = Child("run", path)
    try:
        daemon.line()
        pids = pids_in(path).values()
        daemon.kill()
        until(lambda: all(map(is_gone, pids)), "their end")
        assert [each.command_pa for each in simulated] == pytest.approx([70e3, 70e3])
    finally:
        daemon.close()
        for each in devices:
            each.stop()
    assert {line["reason"] for line in said(path, "stopped")} == {"the daemon is gone"}


def test_one_that_cannot_begin_is_refused_in_its_words(shared: tuple[Path, list[Share]]) -> None:
    path, shares = shared
    held = [
        each.model_copy(update={"memory": each.memory.model_copy(update={"folder": "m"})}) for each in shares[1].files
    ]
    (path.parent / "m").write_text("no folder")
    with ExitStack() as on_exit, pytest.raises(InputError, match="cannot be kept there"):
        Workers([Share(held, [None], path, is_whole=False)], RequestCounts(), list[Told]().append, on_exit)


def test_valves_of_a_line_stay_together_and_loads_are_alike(tmp_path: Path) -> None:
    path = tmp_path / "lines.toml"
    serial = (
        'device = { bus = "rtu", unit = 1, serial = { path = "/dev/ttyS0", baud = 115200 }, reply_timeout_s = 0.05 }'
    )
    path.write_text(
        "[cycle]\nperiod_s = 0.5\n"
        + "".join(
            f"[[valve]]\nname = 'V{unit}'\nunit = {unit}\nstroke_m = 0.1\n"
            + (serial.replace("unit = 1", f"unit = {unit}") if unit < 4 else f"device = {{ port = {5000 + unit} }}")
            + "\n"
            for unit in range(1, 9)
        )
    )
    files = load_valves(path)
    shares = Share(files, [None] * len(files), path, is_whole=True).split(2)
    assert sorted(len(each.files) for each in shares) == [4, 4]
    assert [{1, 2, 3} <= {file.supervisory.unit for file in each.files} for each in shares] == [True, False]
    assert len(Share(files, [None] * len(files), path, is_whole=True).split(64)) == 6, "no more than lines"

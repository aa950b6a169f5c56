"""Several valves in one daemon: registers, recordings and logs apart, and no dead device a burden to the others."""

import json
import logging
import os
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread

import pytest

from config.codes import Fault, Mode, Quality
from config.daemon_file import DaemonFile
from config.recording import read_recording
from config.slave_file import SlaveFile
from config.valve_file import shipped_valve
from drivers import driver_for
from drivers.boundary import Capabilities, NoConnection, NoReply, Reading
from fieldbus.modbus.function_codes import RegisterAnswers
from fieldbus.modbus.rtu import ECHO, framed, is_whole
from fieldbus.modbus.server import RegisterServer
from positioner.cli import doctor
from positioner.cli.main import main
from positioner.cli.parts.children import port_in
from positioner.control.controller import Controller
from positioner.control.requests import Requests
from positioner.control.settings import Settings
from positioner.daemon import cycle as cycle_module
from positioner.daemon import pacing
from positioner.daemon.cycle import Cycle, run_in_turn
from positioner.daemon.link import Link
from positioner.daemon.logs import log_event, logging_valve, start_logging
from positioner.daemon.pacing import DevicePace, RealTimePace
from positioner.daemon.recorder import Recorder
from positioner.dcs import Dcs, DcsError
from sim.slave.clocks import Lockstep
from sim.slave.device_registers import DeviceRegisters
from sim.slave.simulated_device import Device
from sim.slave.slave import device_of
from tests.children import running
from tests.waiting import until

pytestmark = pytest.mark.real_time

WITHIN_S = 60.0
VALVES = 8
NAMES = [f"FV-{number}" for number in range(1, VALVES + 1)]
STROKE_M = 0.1016

# ---- one line, in virtual time


class Clock:
    """The one clock of a line's thread: sleeping and waiting for replies moves it."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        self.now_s += duration_s


class OnTheLine:
    """A device that takes 10 ms to answer; one that is dead, 60 ms to be given up."""

    capabilities = Capabilities(one_transaction=True, device_time=False, sample_counter=False)

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.dead = False
        self.asked_s: list[float] = []

    def open(self) -> float:
        self._talk(NoConnection("nobody answers"))
        return 50e3

    def read(self) -> Reading:
        return Reading(0.05, 50e3)

    def write(self, command_pa: float) -> None:
        pass

    def exchange(self, command_pa: float) -> Reading:
        self.asked_s.append(self.clock.now_s)
        self._talk(NoReply("silent"))
        return Reading(0.05, command_pa)

    def close(self) -> None:
        pass

    def _talk(self, otherwise: NoConnection | NoReply) -> None:
        self.clock.sleep(0.06 if self.dead else 0.01)
        if self.dead:
            raise otherwise


def line(monkeypatch: pytest.MonkeyPatch, dies: bool) -> tuple[list[OnTheLine], list[Cycle]]:
    """Run four valves on one line for 200 periods of 0.25 s; the second dies in the 50th, if any."""
    clock = Clock()
    monkeypatch.setattr(pacing, "time", clock)
    monkeypatch.setattr(cycle_module, "time", clock)
    monkeypatch.setattr(pacing, "raise_priority", lambda: True)
    file = DaemonFile.model_validate({"valve": {"stroke_m": STROKE_M}, "cycle": {"period_s": 0.25}})
    devices, cycles, stop = [OnTheLine(clock) for _ in range(4)], [], Event()
    for index, device in enumerate(devices):
        pace = RealTimePace(0.25, 0.25 * index / 4, may_spin=False)
        link = Link(device, pace)
        held_pa, _ = link.open()
        cycles.append(Cycle(link, Controller(Settings.of(file), held_pa), pace, Requests(), None))

    last = cycles[-1]
    whole = last.once

    def once() -> None:
        whole()
        devices[1].dead = dies and last.statistics.cycles >= 50
        if last.statistics.cycles >= 200:
            stop.set()

    monkeypatch.setattr(last, "once", once)
    run_in_turn(cycles, stop)
    return devices, cycles


def test_on_one_line_a_dead_device_takes_time_from_nobody_but_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its time-out is six times an answer's; still the others are asked at the very same moments."""
    alive, undisturbed = line(monkeypatch, dies=False)
    disturbed_devices, disturbed = line(monkeypatch, dies=True)
    assert disturbed[1].link.counts.lost_replies > 3, "and then ever more seldom"
    assert disturbed[1].snapshot.decision.fault is Fault.NO_REPLY
    for index in (0, 2, 3):
        assert disturbed_devices[index].asked_s == pytest.approx(alive[index].asked_s, abs=1e-6)
        before, after = undisturbed[index].statistics, disturbed[index].statistics
        assert (after.cycles, after.missed_periods) == (before.cycles, before.missed_periods)
        assert after.period_s() == pytest.approx(before.period_s())
        assert after.jitter_99_s() == pytest.approx(before.jitter_99_s(), abs=1e-6)
        assert disturbed[index].link.counts.lost_replies == 0


def test_each_has_its_own_slot_of_the_period(monkeypatch: pytest.MonkeyPatch) -> None:
    devices, _ = line(monkeypatch, dies=False)
    for index, device in enumerate(devices):
        assert [each % 0.25 for each in device.asked_s[1:]] == pytest.approx(
            [0.0625 * index] * (len(device.asked_s) - 1)
        )


class SerialDevices:
    """Devices on one serial line, a pseudo-terminal, by unit; those that are dead are silent."""

    def __init__(self, units: list[int]) -> None:
        self.dead: set[int] = set()
        self._units = {unit: RegisterAnswers(registers_at(unit)) for unit in units}
        self._master, self._slave = os.openpty()
        tty.setraw(self._master)
        self.path = os.ttyname(self._slave)
        self._thread = Thread(target=self._work)
        self._thread.start()

    def stop(self) -> None:
        os.write(self._slave, b"end")
        self._thread.join()
        os.close(self._master)
        os.close(self._slave)

    def _work(self) -> None:
        heard = b""
        while (more := os.read(self._master, 300)) != b"end":
            heard += more
            if not is_whole(heard):
                continue
            unit, pdu = heard[0], heard[1:-2]
            heard = b""
            if unit not in self.dead:
                answer = pdu if pdu.startswith(ECHO) else self._units[unit].answer(pdu, "line")
                os.write(self._master, framed(unit, answer))


def test_on_one_serial_line_the_others_lose_nothing_while_one_is_dead_nor_when_it_returns() -> None:
    """The drivers and the line are the real ones; as fast as they answer, so that only time-outs take time."""
    devices = SerialDevices([1, 2, 3])
    try:
        cycles: list[Cycle] = []
        for unit in (1, 2, 3):
            serial = {"path": devices.path, "baud": 115200}
            tables = {"bus": "rtu", "serial": serial, "unit": unit, "reply_timeout_s": 0.25}
            file = DaemonFile.model_validate(
                {"valve": {"stroke_m": STROKE_M}, "device": tables, "cycle": {"pace": "device"}}
            )
            pace = DevicePace()
            link = Link(driver_for(file.device), pace)
            held_pa, _ = link.open()
            cycles.append(Cycle(link, Controller(Settings.of(file), held_pa), pace, Requests(), None))
        seen: list[list[Quality]] = []
        for number in range(15):
            devices.dead = {2} if 5 <= number < 9 else set()
            for cycle in cycles:
                cycle.turn()
            seen.append([cycle.snapshot.sample.quality for cycle in cycles])
        assert {qualities[0] for qualities in seen} == {qualities[2] for qualities in seen} == {Quality.GOOD}
        assert [qualities[1] is Quality.LOST for qualities in seen] == [5 <= number < 9 for number in range(15)]
        assert [cycle.link.counts.lost_samples for cycle in cycles] == [0, 0, 0]
        positions_m = [cycle.snapshot.sample.position_m for cycle in cycles]
        assert positions_m == pytest.approx([0.01, 0.02, 0.03], abs=1e-4), "each its own"
        for cycle in cycles:
            cycle.link.release()
    finally:
        devices.stop()


# ---- eight valves on Modbus TCP, the daemon a process of its own, or some that share them


@dataclass
class Site:
    """Eight devices in lockstep, and the daemon."""

    devices: list[RegisterServer]
    port: int
    path: Path

    def dcs(self, valve: int) -> Dcs:
        return Dcs("127.0.0.1", self.port, unit=10 + valve)

    def get(self, valve: int, *names: str) -> dict[str, float]:
        """Read; a worker that a busy machine lets answer late says exception 11 until it has, and is asked again."""
        end_s = time.monotonic() + WITHIN_S
        while True:
            with self.dcs(valve) as dcs:
                try:
                    return dcs.get_all(*names)
                except DcsError as error:
                    if "exception 11" not in str(error) or time.monotonic() > end_s:
                        raise
            time.sleep(0.02)


def simulated_at(number: int) -> Device:
    """Return a simulated device whose stem is at 10 mm times its number."""
    file = SlaveFile.model_validate(
        {"clock": {"mode": "lockstep"}, "initial": {"position_m": 0.01 * number, "pressure_pa": 8e3 * number}}
    )
    return device_of(file, shipped_valve("seed"))


def registers_at(number: int) -> DeviceRegisters:
    """Return the registers of such a device in lockstep."""
    return registers_of(simulated_at(number))


def registers_of(simulated: Device) -> DeviceRegisters:
    """Return a device's registers in lockstep."""
    return DeviceRegisters(simulated, Lockstep(simulated))


def device(number: int, port: int = 0) -> RegisterServer:
    """Serve such a device on Modbus TCP."""
    return served(registers_at(number), port)


def served(registers: DeviceRegisters, port: int = 0) -> RegisterServer:
    """Serve a device on Modbus TCP."""
    server = RegisterServer(registers, "127.0.0.1", port, 1)
    server.start()
    return server


def fleet_file(folder: Path, ports: list[int], processes: int = 1) -> Path:
    path = folder / "fleet.toml"
    common = (
        f"[service]\nprocesses = {processes}\n"
        "[device]\nreply_timeout_s = 2.0\n[cycle]\nperiod_s = 0.01\n[supervisory]\nport = 0\n"
        "[recorder]\nfolder = 'recordings'\n[safety]\nstale_after_s = 60.0\n"
    )
    valves = (
        f"[[valve]]\nname = '{name}'\nunit = {11 + index}\nstroke_m = {STROKE_M}\n[valve.device]\nport = {port}\n"
        for index, (name, port) in enumerate(zip(NAMES, ports, strict=True))
    )
    path.write_text(common + "".join(valves))
    return path


@contextmanager
def fleet(folder: Path, absent: int | None = None, processes: int = 1) -> Iterator[Site]:
    devices = [device(number) for number in range(1, VALVES + 1)]
    path = fleet_file(folder, [each.port for each in devices], processes)
    if absent is not None:
        devices[absent - 1].stop()
    try:
        with running("run", path) as ready:
            yield Site(devices, port_in(ready), path)
    finally:
        for each in devices:
            each.stop()


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """All that a daemon of several valves promises holds as well where its processes share them."""
    with fleet(tmp_path_factory.mktemp("fleet"), processes=3) as here:
        yield here


def test_each_valve_answers_under_its_unit(site: Site) -> None:
    for valve in range(1, VALVES + 1):
        assert site.get(valve, "position_m")["position_m"] == pytest.approx(0.01 * valve, abs=1e-4)


@pytest.mark.parametrize("unit", [0, 1, 10, 19, 255])
def test_a_unit_that_is_no_valves_is_a_gateway_target_that_does_not_answer(site: Site, unit: int) -> None:
    with Dcs("127.0.0.1", site.port, unit=unit) as dcs, pytest.raises(DcsError, match="exception 11"):
        dcs.get("position")


def test_a_write_moves_its_valve_and_no_other(site: Site) -> None:
    before = [site.get(valve, "position_m", "mode", "reference") for valve in range(1, VALVES + 1)]
    with site.dcs(3) as dcs:
        dcs.set_all({"mode": Mode.MANUAL, "manual_pressure": 90e3})
        until(lambda: dcs.get("position_m") > 0.05, "the stem's motion")
        dcs.set("mode", Mode.HOLD)
    for valve in {*range(1, VALVES + 1)} - {3}:
        now = site.get(valve, "position_m", "mode", "reference")
        assert now == pytest.approx(before[valve - 1], abs=1e-6)


def test_the_commands_find_a_valve_by_its_name(site: Site, capsys: pytest.CaptureFixture[str]) -> None:
    where = ["--config", str(site.path), "--port", str(site.port)]
    site.get(5, "position_m")
    assert main(["get", "position_m", *where, "--valve", "FV-5"]) == 0
    assert float(capsys.readouterr().out) == pytest.approx(0.05, abs=1e-4)
    assert main(["get", "position_m", *where]) == 2
    assert "has several valves, say which: FV-1, FV-2," in capsys.readouterr().err
    assert main(["get", "position_m", *where, "--valve", "FV-9"]) == 2
    assert "valve: allowed are FV-1, FV-2" in capsys.readouterr().err
    assert main(["get", "position_m", "--valve", "FV-5"]) == 2
    assert "--valve: needs --config" in capsys.readouterr().err


def test_probe_and_doctor_name_the_valve(
    site: Site, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["probe", str(site.path), "--valve", "FV-4", "--count", "1"]) == 0
    assert "FV-4 holds 32000.0 Pa" in capsys.readouterr().out
    monkeypatch.setattr(doctor, "PERIODS", 50)  # the machine's timing is no matter here
    main(["doctor", str(site.path)])
    lines = capsys.readouterr().out.splitlines()
    for check in ("bus", "certificates"):
        checked = [line for line in lines if line.startswith(f"{check} ")]
        assert [name in line for name, line in zip(NAMES, checked, strict=True)] == [True] * VALVES


def test_a_device_that_hangs_stops_its_own_cycle_only(site: Site) -> None:
    """It takes requests and answers none: its thread waits out the time-out, the others cycle on."""
    others = [1, 2, 4]
    with site.devices[4].lock:
        until(lambda: site.get(5, "lost_replies")["lost_replies"] > 0, "the time-out")
        before = {valve: site.get(valve, "cycles", "lost_replies") for valve in (5, *others)}
        until(lambda: site.get(1, "cycles")["cycles"] > before[1]["cycles"] + 100, "cycles")
        after = {valve: site.get(valve, "cycles", "lost_replies") for valve in (5, *others)}
    for valve in others:
        assert after[valve]["cycles"] >= before[valve]["cycles"] + 80
        assert after[valve]["lost_replies"] == before[valve]["lost_replies"] == 0
    assert after[5]["cycles"] <= before[5]["cycles"] + 20
    until(lambda: site.get(5, "quality")["quality"] == 0, "good measurements again")


def test_a_killed_device_is_its_valves_fault_alone_and_comes_back_without_a_restart(site: Site) -> None:
    others = sorted({*range(1, VALVES + 1)} - {5, 7})  # 5 had its own time in the test before
    names = ("lost_replies", "lost_samples", "fault")
    before = {valve: site.get(valve, *names) for valve in others}
    killed = site.devices[6]
    port = killed.port
    killed.stop()
    until(lambda: site.get(7, "fault")["fault"] == Fault.NO_REPLY, "the fault")
    cycles = {valve: site.get(valve, "cycles")["cycles"] for valve in others}
    until(lambda: all(site.get(each, "cycles")["cycles"] > cycles[each] + 100 for each in others), "cycles")
    assert {valve: site.get(valve, *names) for valve in others} == before
    site.devices[6] = device(7, port)
    until(lambda: site.get(7, "quality")["quality"] == 0, "good measurements")
    with site.dcs(7) as dcs:
        assert dcs.get("fault") == Fault.NO_REPLY, "latched"
        dcs.set("acknowledge", 1)
        until(lambda: dcs.get("fault") == Fault.NONE, "the acknowledgement")
        assert dcs.get("command") == pytest.approx(56e3)


def test_each_valve_has_its_own_recording(site: Site) -> None:
    for valve in (1, 2):
        (path,) = (site.path.parent / "recordings").glob(f"FV-{valve}-*.csv")
        until(lambda path=path: len(path.read_text().splitlines()) > 20, "rows")  # type: ignore[misc]
        assert read_recording(path).position_m[0] == pytest.approx(0.01 * valve, abs=1e-4)


def test_a_device_that_is_not_there_at_the_start_is_its_valves_fault_alone(tmp_path: Path) -> None:
    with fleet(tmp_path, absent=2) as here:
        until(lambda: here.get(2, "fault")["fault"] == Fault.NO_REPLY, "the fault")
        until(lambda: here.get(1, "quality")["quality"] == 0, "good measurements of the other")
        assert here.get(1, "fault")["fault"] == Fault.NONE
        here.devices[1] = device(2, port_of(here.path, 2))
        until(lambda: here.get(2, "quality")["quality"] == 0, "the device")
        state = here.get(2, "fault", "command", "position_m")
        assert state["fault"] == Fault.NONE, "it was not there yet, and nothing is latched"
        assert state["command"] == pytest.approx(16e3), "what it held is held"
        assert state["position_m"] == pytest.approx(0.02, abs=1e-4)
    lines = [json.loads(line) for line in here.path.with_suffix(".log").read_text().splitlines()]
    (absent,) = (line for line in lines if line["event"] == "device is not there")
    assert absent["valve"] == "FV-2"
    assert {line["valve"] for line in lines if line["event"] == "serving"} == set(NAMES)
    assert {line["valve"] for line in lines if line["event"] == "decision" and line["fault"] != "NONE"} == {"FV-2"}


def port_of(path: Path, valve: int) -> int:
    text = path.read_text().split("[valve.device]\nport = ")[valve]
    return int(text.split("\n")[0])


@pytest.mark.usefixtures("root_logging")
def test_a_line_of_the_log_names_the_valve_it_is_about(capsys: pytest.CaptureFixture[str]) -> None:
    log = logging.getLogger("test_fleet")
    listener = start_logging("info")
    with logging_valve("FV-1"):
        log_event(log, logging.INFO, "one")
    log_event(log, logging.INFO, "two")
    listener.stop()
    one, two = (json.loads(line) for line in capsys.readouterr().err.splitlines())
    assert one["valve"] == "FV-1"
    assert "valve" not in two


def test_a_valve_deletes_no_recordings_of_one_whose_name_begins_alike(tmp_path: Path) -> None:
    others = [tmp_path / f"FV-1-A-20260101T00000{n}Z-0001.csv" for n in range(3)]
    own = [tmp_path / f"FV-1-20260101T00000{n}Z-0001.csv" for n in range(3)]
    for path in (*others, *own):
        path.write_text("")
    recorder = Recorder(tmp_path, "FV-1", 100_000, 2)
    recorder.start()
    recorder.stop()
    assert all(path.exists() for path in others)
    assert [path.exists() for path in own] == [False, False, True]

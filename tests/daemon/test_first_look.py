"""What `run` does not start with, and what `probe` and `doctor` say of numbers that cannot be, or hardly are."""

import re
import struct
from pathlib import Path
from typing import Any

import pytest

from config.daemon_file import DaemonFile, load_daemon
from config.device import ModbusRtuDevice
from config.modbus_map import Place
from config.slave_file import load_slave
from drivers.boundary import Reading
from positioner.cli.main import main
from positioner.cli.probe import unfit
from positioner.control.settings import Settings
from positioner.daemon.first_look import doubts, impossible, travel_in_registers
from tests.drivers.raw_device import Habits, RawDevice

HELD_PA, STEM_M, STROKE_M = 52e3, 0.0271, 0.1
LAW = {"b_over_c_pa_per_m": -1.0e6, "k_over_c_pa": -12e3, "offset_pa": 20e3}


def daemon(**more: Any) -> DaemonFile:
    return DaemonFile.model_validate({"valve": {"stroke_m": STROKE_M}, **more})


def said(file: DaemonFile, reading: Reading, held_pa: float = HELD_PA) -> str:
    return impossible(file, held_pa, reading, Settings.of(file).limits) or doubts(file, held_pa, reading)


def swapped(value: float, order: str) -> float:
    """Return what a float reads as whose words (CDAB), bytes (BADC) or both (DCBA) are taken in the wrong order."""
    data = struct.pack(">f", value)
    a, b, c, d = data
    (read,) = struct.unpack(">f", bytes({"CDAB": (c, d, a, b), "BADC": (b, a, d, c), "DCBA": (d, c, b, a)}[order]))
    return float(read)


KEYS = {
    "CDAB": 'word_order = "little"',
    "BADC": 'byte_order = "little"',
    "DCBA": 'word_order = "little", byte_order = "little"',
}


@pytest.mark.parametrize("order", KEYS)
@pytest.mark.parametrize("stem_m", [0.0271, 0.05, 0.002])
def test_words_in_the_wrong_order_are_said_with_the_order_that_fits(order: str, stem_m: float) -> None:
    assert f"{KEYS[order]} would read {stem_m:g} m" in said(daemon(), Reading(swapped(stem_m, order)))


@pytest.mark.parametrize("order", KEYS)
def test_so_is_a_command_and_a_pressure(order: str) -> None:
    held_pa = swapped(HELD_PA, order)
    assert f"{KEYS[order]} would read 52000 Pa" in said(daemon(), Reading(STEM_M), held_pa)
    found = said(daemon(), Reading(STEM_M, swapped(51.9e3, order)))
    assert found.startswith("device.map.pressure_pa: ")
    assert f"{KEYS[order]} would read 51900 Pa" in found


def test_a_place_that_was_told_another_order_names_only_the_keys_that_change() -> None:
    place = Place(address=0, word_order="little", byte_order="little")
    assert set(place.in_other_orders(STEM_M)) == {
        'word_order = "big", byte_order = "big"',
        'word_order = "big"',
        'byte_order = "big"',
    }
    assert set(Place(address=0, type="uint16").in_other_orders(5.0)) == {'byte_order = "little"'}


@pytest.mark.parametrize(
    ("reading", "held_pa", "wanted"),
    [
        (Reading(STEM_M, 51.2e3), HELD_PA, ""),
        (Reading(STEM_M, 0.0), HELD_PA, ""),
        (Reading(STEM_M, -3e3), 0.0, ""),
        (Reading(0.0, 0.0), 0.0, ""),
        (Reading(STEM_M, 420e3), HELD_PA, ""),
        (Reading(-0.005), HELD_PA, ""),
        (Reading(0.5), HELD_PA, "position_m: the device says 0.5 m, allowed is -0.01 to 0.11 m"),
        (Reading(float("nan")), HELD_PA, "position_m: the device says nan m"),
        (Reading(STEM_M), 500e3, "command_pa: the device holds 500000 Pa, allowed is 0 to 420000 Pa"),
        (Reading(STEM_M, 6.5e6), HELD_PA, "pressure_pa: it shows 6.5e.06 Pa, commands go up to 420000 Pa"),
        (Reading(STEM_M, -200e3), HELD_PA, "pressure_pa: it shows -200000 Pa"),
        (Reading(STEM_M, 520e3), HELD_PA, r"it shows 520000 Pa, 10 times the 52000 Pa that it holds: .*scale"),
        (Reading(STEM_M, 5.21e3), HELD_PA, r"it shows 5210 Pa, 0\.1 times the 52000 Pa that it holds: .*scale"),
        (Reading(STEM_M, 0.52e3), HELD_PA, r"it shows 520 Pa, 0\.01 times"),
    ],
)
def test_what_cannot_be_is_said(reading: Reading, held_pa: float, wanted: str) -> None:
    """A pressure of 6.5 MPa, or ten times the command, was plausible to `probe` and `doctor`."""
    found = said(daemon(), reading, held_pa)
    assert re.search(wanted, found) if wanted else found == ""


@pytest.mark.parametrize(("position_m", "times"), [(0.0285, ""), (0.04, ""), (0.00285, "0.1"), (0.0029, "0.1")])
def test_a_position_ten_times_off_is_said_where_a_law_is_known(position_m: float, times: str) -> None:
    found = said(daemon(law=LAW), Reading(position_m, 51e3))
    assert (f"is {times} times what [law] has at 51000 Pa" in found) if times else found == ""


@pytest.mark.parametrize(
    ("place", "wanted"),
    [
        ({"position_m": {"address": 0, "type": "uint16", "scale": 1e-6}}, "0.1 m (valve.stroke_m) would be 100000"),
        ({"command_pa": {"address": 9, "type": "uint16"}}, "420000 Pa (pressure.maximum_pa) would be 420000"),
        ({}, ""),
    ],
)
def test_a_register_that_cannot_hold_what_it_must_is_said(place: dict[str, Any], wanted: str) -> None:
    places = {"position_m": {"address": 0, "type": "uint16", "scale": 1e-5}, "command_pa": {"address": 4}}
    file = daemon(device={"map": {**places, **place}})
    assert wanted in doubts(file, HELD_PA, Reading(STEM_M))
    if not wanted:
        assert travel_in_registers(file) == "its travel is 0 to 10000 in its register"


@pytest.mark.parametrize(
    ("status", "wanted"),
    [
        (0, ""),
        (64, ""),
        (1, "communication lost, which is a fault, by its status 1; .*status_bits"),
        (66, "sensor fault, which is a fault, by its status 66"),
    ],
)
def test_what_the_device_says_of_itself_is_said(status: int, wanted: str) -> None:
    """`doctor` called a device ok whose status is a fault as soon as `run` sees it; `probe` printed its number."""
    found = unfit(Reading(STEM_M, status=status))
    assert re.search(wanted, found) if wanted else found == ""


@pytest.mark.real_time
def test_probe_doctor_and_run_refuse_words_in_the_wrong_order(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """2.9e-18 m lies inside the travel: `probe` called it plausible, `doctor` passed it, and `run` drove."""
    device = RawDevice(Habits(swapped=(True, False)))
    device.put_float(2, STEM_M)
    device.put_float(10, HELD_PA)
    path = tmp_path / "daemon.toml"
    places = "map = { position_m = { address = 2 }, command_pa = { address = 10 } }"
    path.write_text(
        f"[valve]\nstroke_m = {STROKE_M}\n[device]\nport = {device.port}\nreply_timeout_s = 5.0\n{places}\n"
        "[supervisory]\nport = 0\n"
    )
    wanted = f"{KEYS['CDAB']} would read 0.0271 m"
    assert main(["probe", str(path), "--count", "1"]) == 1
    assert re.search(f"NOT plausible: .*{wanted}", capsys.readouterr().out)
    assert main(["doctor", str(path)]) == 1
    out = capsys.readouterr().out
    assert re.search(f"bus +FAILS .*{wanted}", out)
    assert re.search(r"history +ok +none configured: nobody can say later who wrote a set point", out)
    assert main(["run", str(path)]) == 2
    assert wanted in capsys.readouterr().err
    device.close()


def test_a_serial_line_counts_from_the_folder_of_its_file(tmp_path: Path) -> None:
    """It counted from the folder in which the command was typed, against what daemon.toml says."""
    path = tmp_path / "daemon.toml"
    for written, found in (("line", str(tmp_path / "line")), ("/dev/ttyUSB0", "/dev/ttyUSB0")):
        path.write_text(f'[valve]\nstroke_m = 0.1\n[device]\nbus = "rtu"\nserial = {{ path = "{written}" }}\n')
        device = load_daemon(path).device
        assert isinstance(device, ModbusRtuDevice)
        assert (device.serial.path, device.line) == (found, found)
    slave = tmp_path / "slave.toml"
    slave.write_text('[bus]\nkind = "rtu"\nserial = { path = "line" }\n')
    bus = load_slave(slave).bus
    assert bus.kind == "rtu"
    assert bus.serial.path == str(tmp_path / "line")

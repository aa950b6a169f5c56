"""A rotary valve is commissioned, tested and reported in degrees and newton metres: nobody sees a metre or a radian."""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from math import degrees, radians
from pathlib import Path

import pytest

from config.daemon_file import DaemonFile, load_daemon
from config.errors import InputError
from config.registers import REGISTERS
from config.slave_file import Initial, load_slave
from config.valve_file import load_valve, shipped_valve
from positioner.cli.main import main
from tests.tests_on_the_valve.virtual_valve import VirtualValve

ROTARY = load_valve(shipped_valve("rotary"))
VALVE = ROTARY.valve
TORQUE_NM_PER_PA, TRAVEL_RAD = VALVE.diaphragm_area_m2, VALVE.stroke_m
SPRING_PA_PER_DEG = radians(VALVE.spring_n_per_m) / TORQUE_NM_PER_PA
FRICTION_NM = VALVE.coulomb_n
"""Of a shaft that slides all the way: ramps of 23 s; in slower ones it sticks, and shows more."""
SITE = """[valve]
name = "FV-401"
travel_deg = 95.0
[cycle]
pace = "device"
[pressure]
maximum_pa = 280e3
[safety]
stale_after_s = 0.5
[experiment]
travel_window = [0, 1]
limit_s = 60
[device.map]
position_deg = { address = 0, type = "int16", scale = 0.0244140625 }
command_pa = { address = 10, type = "uint16", scale = 10.0 }
"""


class Rotary(VirtualValve):
    """In place of `RunningValve`, and of one on a bus."""

    def __init__(self, file: DaemonFile) -> None:
        initial = Initial(position_m=radians(45.0), pressure_pa=120e3)
        super().__init__(ROTARY, file, noise=5e-4, initial=initial, maximum_pa=280e3)

    def stem_m(self) -> float:
        return self.cycle.snapshot.sample.position_m

    def dead_band_pa(self) -> float:
        return 2.0 * FRICTION_NM / TORQUE_NM_PER_PA

    def slope_pa_per_m(self) -> float:
        return degrees(SPRING_PA_PER_DEG)


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    @contextmanager
    def in_memory(file: DaemonFile, _source: Path) -> Iterator[Rotary]:
        yield Rotary(file)

    monkeypatch.setattr("positioner.cli.commission.own_valve", in_memory)
    monkeypatch.setattr("positioner.cli.parts.experiment_player.require_ready", lambda *_: None)
    monkeypatch.setattr("positioner.cli.parts.experiment_player.RunningValve", lambda file, _: Rotary(file))
    path = tmp_path / "site.toml"
    path.write_text(SITE)
    return path


def test_it_is_commissioned_tested_and_reported_in_degrees_and_newton_metres(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["commission", str(site), "--yes", "--keep", "as_left"]) == 0, capsys.readouterr().err
    file = load_daemon(site)
    assert file.valve.travel_deg == pytest.approx(90.0, rel=2e-3)
    assert "position_deg = { address = 0" in site.read_text(), "what is not found stays as it is written"
    assert f"b_over_c_pa_per_deg = -{SPRING_PA_PER_DEG:.2g}"[:24] in site.read_text()
    assert file.law is not None
    assert file.law.b_over_c_pa_per_m == pytest.approx(-degrees(SPRING_PA_PER_DEG), rel=0.01)

    told = tmp_path / "told.json"
    words = ["--torque-nm-per-pa", str(TORQUE_NM_PER_PA), "--json", str(told), "--keep", "as_left"]
    main(["signature", str(site), *words])
    figures = json.loads(told.read_text())["figures"]
    truth = {
        "travel_rad": (TRAVEL_RAD, "rad", 0.005),
        "spring_nm_per_rad": (VALVE.spring_n_per_m, "N m/rad", 0.01),
        "friction_nm": (FRICTION_NM, "N m", 0.03),
        "seat_load_nm": (72.0 - FRICTION_NM, "N m", 0.02),
    }
    for name, (true, unit, within) in truth.items():
        assert (figures[name]["unit"], figures[name]["value"]) == (unit, pytest.approx(true, rel=within)), name
    main(["pst", str(site), "--keep", "as_left"])
    main(["cst", str(site), "--rate", "0.01", "--keep", "as_left"])
    main(["steps", str(site), "--held-s", "0.3", "--keep", "as_left"])
    out = tmp_path / "FV-401.html"
    assert main(["report", str(site), "-o", str(out)]) == 0
    seen = capsys.readouterr().out + out.read_text()
    assert all(unit in seen for unit in (" deg", " kPa/deg", " N m", "travel, deg"))
    for metres in (" mm", " m,", " N<", "kPa/mm", "rad", "stroke_m"):
        assert metres not in seen.replace("gradient", ""), metres


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("travel_deg = 95.0", "stroke_m = 1.6\ntravel_deg = 95.0", "allowed is one of them"),
        ("position_deg", "position_m", "device.map.position_m: a rotary valve has position_deg in its place"),
        ("travel_deg = 95.0", 'travel_deg = "wide"', "valve.travel_deg: Input should be a valid number"),
        ("travel_deg = 95.0", "stroke_m = 0.04", "device.map.position_deg: unknown key"),
    ],
)
def test_a_file_that_mixes_lengths_and_angles_is_refused_in_a_line(
    before: str, after: str, said: str, tmp_path: Path
) -> None:
    path = tmp_path / "site.toml"
    path.write_text(SITE.replace(before, after))
    with pytest.raises(InputError, match=said):
        load_daemon(path)


@pytest.mark.parametrize("bus", ["", '[device]\nbus = "canopen"\n'])
def test_a_device_whose_registers_are_in_metres_is_refused(bus: str, tmp_path: Path) -> None:
    site, slave = tmp_path / "site.toml", tmp_path / "slave.toml"
    site.write_text(f"[valve]\ntravel_deg = 90.0\n{bus}")
    slave.write_text('valve = "rotary"\n' + bus.replace("device", "bus").replace("bus =", "kind ="))
    needed = r"\.map: is required of a rotary valve, with position_deg"
    with pytest.raises(InputError, match=rf"site\.toml: device{needed}"):
        load_daemon(site)
    with pytest.raises(InputError, match=rf"slave\.toml: bus{needed}"):
        load_slave(slave)


def test_a_register_whose_unit_has_a_metre_says_what_it_has_where_it_turns() -> None:
    metres = [each for each in REGISTERS if "m" in re.split(r"[^a-z]", each.unit)]
    assert metres
    for each in metres:
        assert "it turns" in each.text or each.name == "position_m", each.name

"""A drive in the workbench: the valve's numbers, in the drive's words and units."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from config.drive import KINDS
from config.errors import InputError
from config.recording import Recording
from config.valve_file import ValveFile, load_valve
from sim.simulation import simulate
from sim.static_inverse import extended_valve
from workbench.compare.comparison import Comparison, compare
from workbench.compare.slip_matching import SlipEvents
from workbench.fit.fitting import fit
from workbench.report.comparison_report import report_comparison
from workbench.report.display_units import Reading
from workbench.report.overlay import overlay
from workbench.report.report_html import Subject

NOISE_RAD = 5e-4
DRIVE = """[drive]
kind = "rotary motor"
name = "axis 1"
torque_nm_per_a = 0.2
inertia_kg_m2 = 2e-4
viscous_nms_per_rad = 2e-3
coulomb_nm = 0.03
static_nm = 0.033
stribeck_velocity_rad_per_s = 0.05
travel_rad = 40.0
"""


@pytest.fixture(scope="module")
def axis(tmp_path_factory: pytest.TempPathFactory) -> ValveFile:
    path = tmp_path_factory.mktemp("drive") / "axis.toml"
    path.write_text(DRIVE)
    return load_valve(path)


@pytest.fixture(scope="module")
def recording(axis: ValveFile) -> Recording:
    time_s = np.arange(0.0, 12.0, 0.01)
    current_a = np.where(time_s % 2.0 < 1.0, 0.3, 0.0) * np.where(time_s % 4.0 < 2.0, 1.0, -1.0)
    moved = simulate(axis, time_s, current_a, noise_std_m=NOISE_RAD)
    columns = {"time_s": time_s, "command_a": current_a, "position_rad": moved.position_m}
    return Recording.of(columns, {})


@pytest.fixture(scope="module")
def wrong(axis: ValveFile, recording: Recording) -> Comparison:
    stiff = axis.valve.model_copy(update={"viscous_ns_per_m": 3e-3})
    return compare(recording, ValveFile(valve=stiff))


def test_the_numbers_are_those_of_a_valve_of_the_same_numbers(axis: ValveFile, recording: Recording) -> None:
    as_valve = ValveFile(valve=axis.valve.model_copy(update={"kind": "valve"}))
    same = compare(Recording(recording.columns), as_valve)
    assert compare(recording, axis).residual_m == pytest.approx(same.residual_m, nan_ok=True)


def test_what_is_said_is_in_the_drives_units(wrong: Comparison) -> None:
    said = wrong.summary()
    assert "rad rms" in said
    assert "mm" not in said.split()
    below = wrong.plot().get_axes()
    assert [each.get_ylabel() for each in below] == ["angle, rad", "error, rad"]


def test_a_fit_names_the_drives_parameters(axis: ValveFile, recording: Recording) -> None:
    found = fit(recording, axis, free=("viscous_ns_per_m", "coulomb_n"), workers=1)
    assert found.valve.valve.kind == "rotary motor"
    assert found.valve.valve.coulomb_n == pytest.approx(0.03, rel=0.02)
    said = found.summary()
    assert "coulomb_nm" in said
    assert "coulomb_n " not in said
    assert " rad rms" in said


def test_a_report_draws_it_in_the_drives_units(
    wrong: Comparison, axis: ValveFile, recording: Recording, tmp_path: Path
) -> None:
    path = tmp_path / "report.html"
    subject = Subject(axis, ("axis.csv",), recording.metadata)
    report_comparison(wrong, path, subject)
    text = path.read_text(encoding="utf-8")
    assert "Error, rms, rad" in text
    assert "angle, rad" in text
    assert "command, A" in text
    assert ", mm" not in text
    assert ", kPa" not in text
    assert "Drive “axis 1”" in text


def test_a_slip_is_marked_where_the_drive_was() -> None:
    angle_rad, slips = np.array([0.0, 1.5, 1.5]), SlipEvents((), (1.0,), ())
    figure = overlay(np.arange(3.0), np.zeros(3), angle_rad, [], [], slips, read=Reading(KINDS["rotary"]))
    (mark,) = (each for each in figure["data"] if each["name"] == "missed slip")
    assert (mark["x"], mark["y"]) == ([1.0], [1.5])


def test_a_recording_of_another_kind_is_refused(axis: ValveFile, recording: Recording) -> None:
    torque = replace(recording, metadata={"drive": "rotary"})
    with pytest.raises(InputError, match="has command_nm and position_rad, and the valve file is of a rotary motor"):
        compare(torque, axis)


def test_degrees_taken_for_radians_are_recognised(axis: ValveFile, recording: Recording) -> None:
    degrees = replace(recording, columns={**recording.columns, "position_m": 5000.0 + np.degrees(recording.position_m)})
    with pytest.raises(InputError, match="it looks like deg; import it, --column position_rad=NAME:deg"):
        compare(degrees, axis)


def test_the_daemon_does_not_command_it(axis: ValveFile) -> None:
    with pytest.raises(InputError, match="is of a drive: the daemon commands none"):
        extended_valve(axis, "axis.toml")

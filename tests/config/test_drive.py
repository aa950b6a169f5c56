"""Drives: their files say the same as a valve's, in their own names and units."""

from pathlib import Path

import numpy as np
import pytest

from config.drive import KINDS, VALVE
from config.errors import InputError
from config.recording import Recording
from config.valve_file import EffectTable, ValveFile, ValveParameters, load_valve, shipped_valve
from config.valve_file_writer import write_valve
from positioner.cli.main import main
from sim.composition import Composition
from sim.effect import shipped_effect, shipped_effects
from workbench.imports.column_mapping import read_mapping
from workbench.imports.export_preview import preview
from workbench.imports.historian_export import read_export

MOTOR = """[drive]
kind = "rotary motor"
name = "axis 1"
torque_nm_per_a = 0.35
inertia_kg_m2 = 2e-4
viscous_nms_per_rad = 2.5e-4
coulomb_nm = 0.03
static_nm = 0.031
stribeck_velocity_rad_per_s = 1.0
travel_rad = 40.0

[[effect]]
name = "preload"
force_nm = 0.01

[[effect]]
name = "supply_limit"
supply_a = 0.5
exhaust_a = -0.5
"""
DRIVES = [name for name in KINDS if name != VALVE.name]


def written(folder: Path, text: str) -> Path:
    path = folder / "drive.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", DRIVES)
def test_no_two_parameters_of_an_effect_or_of_the_stem_share_a_name(name: str) -> None:
    kind = KINDS[name]
    for given in (
        [*ValveParameters.model_fields],
        *([*shipped_effect(each, "").parameters] for each in shipped_effects()),
    ):
        assert len({kind.own(each) for each in given}) == len(given)


def test_a_valve_has_the_names_that_it_has() -> None:
    for each in (
        *ValveParameters.model_fields,
        "command_pa",
        "positioner.gain_pa_per_ms",
        "the rest of a sentence, m/s",
    ):
        assert VALVE.own(each) == VALVE.text(each) == each


def test_a_file_is_read_in_the_drives_names_and_written_as_it_was(tmp_path: Path) -> None:
    file = load_valve(written(tmp_path, MOTOR))
    assert (file.valve.kind, file.valve.mass_kg, file.valve.diaphragm_area_m2) == ("rotary motor", 2e-4, 0.35)
    assert (file.valve.spring_n_per_m, file.valve.stroke_m) == (0.0, 40.0)
    assert Composition.from_file(file).theta[-3:] == pytest.approx([0.01, 0.5, -0.5])
    again = tmp_path / "again.toml"
    write_valve(again, file)
    said = again.read_text()
    assert "torque_nm_per_a = 0.35" in said
    assert "force_nm = 0.01" in said
    assert "supply_a = 0.5" in said
    assert load_valve(again) == file


def test_where_the_command_is_the_force_itself_no_factor_is_said(tmp_path: Path) -> None:
    text = MOTOR.replace("rotary motor", "rotary").replace("torque_nm_per_a = 0.35\n", "").replace("_a = ", "_nm = ")
    file = load_valve(written(tmp_path, text))
    assert file.valve.diaphragm_area_m2 == 1.0
    assert Composition.from_file(file).theta[-3:] == pytest.approx([0.01, 0.5, -0.5]), "a command is a torque, too"
    write_valve(tmp_path / "again.toml", file)
    assert "area" not in (tmp_path / "again.toml").read_text()
    assert load_valve(tmp_path / "again.toml") == file


def test_a_valves_command_is_no_force() -> None:
    """Only where a force moves it may `supply_n` stand for `supply_pa`."""
    table = EffectTable.model_validate({"name": "supply_limit", "supply_n": 2e5, "exhaust_pa": 0.0})
    seed = load_valve(shipped_valve("seed")).valve
    with pytest.raises(InputError, match="supply_n: unknown parameter of supply_limit"):
        Composition.from_file(ValveFile(valve=seed, effect=(table,)))


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        (
            "rotary motor",
            "spinning",
            "drive.kind: must be linear, linear motor, rotary, rotary motor or rotary valve, got 'spinning'",
        ),
        ("static_nm = 0.031", "static_nm = 0.01", "static_nm must be at least coulomb_nm (0.03 N m), it is 0.01 N m"),
        ("coulomb_nm = 0.03\n", "", "drive.coulomb_nm: is required and missing"),
        ("torque_nm_per_a = 0.35\n", "", "drive.torque_nm_per_a: is required and missing"),
        ("coulomb_nm = 0.03", "coulomb_n = 0.03", "drive.coulomb_n: unknown key; allowed here: name, inertia_kg_m2, "),
        ("travel_rad = 40.0", "travel_rad = -1", "drive.travel_rad: allowed is 1e-09 to 1e+06, got -1"),
        ("force_nm", "force_n", "effect.force_n: a drive of kind rotary motor has force_nm"),
    ],
)
def test_what_is_wrong_is_one_line_in_the_drives_names(before: str, after: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as refused:
        load_valve(written(tmp_path, MOTOR.replace(before, after)))
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("before", "after", "said"),
    [
        ("force_nm = 0.01", 'force_nm = "x"', "effect preload: force_nm: must be a number from -1e+06 to 1e+06"),
        ("exhaust_a = -0.5\n", "", "effect supply_limit: exhaust_a: is required by supply_limit and missing"),
        (
            "force_nm = 0.01",
            "force_nm = 0.01\nwidth_m = 1.0",
            "effect.width_m: a drive of kind rotary motor has width_rad",
        ),
        ("force_nm", "width", "effect preload: width: unknown parameter of preload; allowed: force_nm"),
    ],
)
def test_what_is_wrong_with_an_effect_is_said_in_the_drives_names_and_with_the_file(
    before: str, after: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before the recording is read, which is not there."""
    path = written(tmp_path, MOTOR.replace(before, after))
    assert main(["compare", str(tmp_path / "none.csv"), "--valve", str(path)]) == 2
    assert f"{path}: {said}" in capsys.readouterr().err


def csv(path: Path, header: str, *columns: object) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")  # type: ignore[arg-type]
    return path


TIME_S = np.arange(200) * 0.01
CURRENT_A, ANGLE_RAD = np.sin(TIME_S), 1.0 - np.cos(TIME_S)


@pytest.mark.parametrize(
    ("header", "kind"),
    [
        ("time_s,command_a,position_rad", "rotary motor"),
        ("time_s,command_nm,position_rad", "rotary"),
        ("time_s,command_a,position_m", "linear motor"),
        ("time_s,command_n,position_m", "linear"),
        ("time_s,command_pa,position_m", "valve"),
    ],
)
def test_the_columns_say_whose_a_recording_is(header: str, kind: str, tmp_path: Path) -> None:
    found = Recording.read(csv(tmp_path / "rec.csv", header, TIME_S, CURRENT_A, ANGLE_RAD))
    assert found.kind.name == kind
    assert found.command_pa == pytest.approx(CURRENT_A)
    assert found.position_m == pytest.approx(ANGLE_RAD)
    found.write(tmp_path / "again.csv")
    lines = (tmp_path / "again.csv").read_text().splitlines()
    assert next(line for line in lines if line[0] != "#") == header
    assert Recording.read(tmp_path / "again.csv").kind.name == kind


def test_a_measured_current_is_the_pressure_that_acts(tmp_path: Path) -> None:
    header = "time_s,command_a,position_rad,current_a"
    found = Recording.read(csv(tmp_path / "rec.csv", header, TIME_S, CURRENT_A, ANGLE_RAD, 0.9 * CURRENT_A))
    assert found.columns["pressure_pa"] == pytest.approx(0.9 * CURRENT_A)


def test_a_velocity_is_integrated_where_no_position_is_said(tmp_path: Path) -> None:
    header = "time_s,command_a,velocity_rad_per_s"
    found = Recording.read(csv(tmp_path / "rec.csv", header, TIME_S, CURRENT_A, np.sin(TIME_S)))
    assert found.position_m == pytest.approx(ANGLE_RAD, abs=1e-4)
    assert found.metadata["position"] == "integrated from velocity_rad_per_s, from zero"
    found.write(tmp_path / "again.csv")
    assert Recording.read(tmp_path / "again.csv").position_m == pytest.approx(found.position_m)


def test_an_export_in_degrees_and_milliamperes_is_read(tmp_path: Path) -> None:
    path = tmp_path / "theirs.csv"
    rows = zip(TIME_S.tolist(), (1e3 * CURRENT_A).tolist(), np.degrees(ANGLE_RAD).tolist(), strict=True)
    path.write_text("t [s];I [mA];phi [deg]\n" + "".join(f"{a:.4f};{b:.6f};{c:.6f}\n" for a, b, c in rows))
    found = read_export(path, read_mapping(["time_s=t", "command_a=I", "position_rad=phi"]), None)
    assert found.kind.name == "rotary motor"
    assert found.command_pa == pytest.approx(CURRENT_A, abs=1e-8)
    assert found.position_m == pytest.approx(ANGLE_RAD, abs=1e-7)


def test_what_reads_an_export_of_a_drive_is_proposed_by_its_units(tmp_path: Path) -> None:
    path = tmp_path / "theirs.csv"
    rows = zip(TIME_S.tolist(), CURRENT_A.tolist(), np.degrees(ANGLE_RAD).tolist(), strict=True)
    path.write_text("t [s];Iq [A];phi [deg]\n" + "".join(f"{a:.4f};{b:.6f};{c:.6f}\n" for a, b, c in rows))
    found = preview(path)
    assert found.proposal.open == ()
    words = [each for each in found.words if "=" in each]
    assert words == ["time_s=t [s]:s", "position_rad=phi [deg]:deg", "command_a=Iq [A]:A"]
    assert read_export(path, read_mapping(words), None).kind.name == "rotary motor"


def test_a_mapping_names_what_a_drives_recording_lacks() -> None:
    with pytest.raises(InputError, match="position_rad is not given: add --column position_rad=THEIRS:UNIT"):
        read_mapping(["time_s=t", "command_nm=M"])

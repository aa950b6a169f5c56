"""Files that people write: each fault is one line that names file, key, value and what is allowed."""

import pickle
from pathlib import Path

import pytest

from config.daemon_file import load_daemon
from config.errors import InputError
from config.valve_file import load_valve, shipped_valve
from northbound.served_valves import places_in

SEED = """[valve]
name = "v"
mass_kg = 1.0
diaphragm_area_m2 = 0.06
spring_n_per_m = 5e4
viscous_ns_per_m = 600.0
coulomb_n = 1400.0
static_n = 1700.0
stribeck_velocity_m_per_s = 2.5e-4
deadzone_ratio = 0.6
stroke_m = 0.1
"""


def problem(path: Path, text: str) -> str:
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_valve(path)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(str(path))
    return line.removeprefix(f"{path}: ")


def test_the_seed_valve_has_the_corrected_static_friction() -> None:
    valve = load_valve(shipped_valve("seed")).valve
    assert valve.static_n == pytest.approx(384 * 4.448222, rel=1e-4)
    assert valve.deadzone_ratio * valve.stribeck_velocity_m_per_s == pytest.approx(0.6 * 2.54e-4)


@pytest.mark.parametrize(
    ("wrong", "right", "said"),
    [
        (
            "mass_lb = 3.0",
            "mass_kg = 1.0",
            "valve.mass_lb: unknown key; allowed here: actuator, coulomb_n, deadzone_ratio,",
        ),
        ("mass_kg = -1.0", "mass_kg = 1.0", "valve.mass_kg: allowed is 1e-09 to 1e+09, got -1.0"),
        ("mass_kg = 1e-320", "mass_kg = 1.0", "valve.mass_kg: allowed is 1e-09 to 1e+09, got 1e-320"),
        (
            "spring_n_per_m = 1e20",
            "spring_n_per_m = 5e4",
            "valve.spring_n_per_m: allowed is 0, or 1e-12 to 1e+12, got 1e+20",
        ),
        ("deadzone_ratio = 1e300", "deadzone_ratio = 0.6", "valve.deadzone_ratio: allowed is 1e-09 to 1e+06"),
        ('mass_kg = "heavy"', "mass_kg = 1.0", "valve.mass_kg: Input should be a valid number"),
        ("mass_kg = true", "mass_kg = 1.0", "valve.mass_kg: Input should be a valid number, got True"),
        ('mass_kg = "5"', "mass_kg = 1.0", "valve.mass_kg: Input should be a valid number, got '5'"),
        ("mass_kg = nan", "mass_kg = 1.0", "valve.mass_kg: Input should be a finite number, got nan"),
        ("", "mass_kg = 1.0", "valve.mass_kg: is required and missing"),
        ("static_n = 1000.0", "static_n = 1700.0", "valve: static_n must be at least coulomb_n (1400 N), it is 1000 N"),
    ],
)
def test_a_wrong_key_or_value_is_named(tmp_path: Path, wrong: str, right: str, said: str) -> None:
    assert problem(tmp_path / "valve.toml", SEED.replace(right, wrong)).startswith(said)


def test_a_table_in_place_of_an_array_of_tables_is_named(tmp_path: Path) -> None:
    said = problem(tmp_path / "valve.toml", SEED + '[effect]\nname = "backlash"\n')
    assert said == "effect: must be an array of tables, [[effect]]"


def test_a_whole_number_is_a_number(tmp_path: Path) -> None:
    path = tmp_path / "valve.toml"
    path.write_text(SEED.replace("mass_kg = 1.0", "mass_kg = 2"))
    assert load_valve(path).valve.mass_kg == 2.0


def test_what_is_no_toml_names_the_line(tmp_path: Path) -> None:
    assert "is not valid TOML" in problem(tmp_path / "valve.toml", SEED.replace("= 1.0", "1.0"))
    assert "line 3" in problem(tmp_path / "valve.toml", SEED.replace("= 1.0", "1.0"))


def test_a_byte_order_mark_is_no_part_of_a_file(tmp_path: Path) -> None:
    path = tmp_path / "valve.toml"
    path.write_text(SEED, encoding="utf-8-sig")
    assert load_valve(path).valve.name == "v"


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml: cannot be read: No such file"):
        load_valve(tmp_path / "none.toml")


def test_effects_keep_their_parameters_for_the_model_side(tmp_path: Path) -> None:
    path = tmp_path / "valve.toml"
    path.write_text(SEED + '\n[[effect]]\nname = "ip_lag"\ntime_constant_s = 0.05\n')
    (effect,) = load_valve(path).effect
    assert (effect.name, effect.parameters) == ("ip_lag", {"time_constant_s": 0.05})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "[valve]\nstroke_mm = 100\n",
            "valve.stroke_mm: unknown key; allowed here: action, actuator, breakaway_pa, name, stroke_m",
        ),
        ("[valve]\nstroke_m = 0.1\n[cycle]\nperiod_s = 1\npace = 'fast'\n", "cycle.pace: Input should be 'real_time'"),
        ("[valve]\nstroke_m = 0.1\n[pressure]\nminimum_pa = 5e5\n", "pressure: minimum_pa must be below maximum_pa"),
        ("[valve]\nstroke_m = 0.1\n[device.map]\nposition_m = {address = 0}\n", "device.map.command_pa: is required"),
        ("[valve]\nstroke_m = 1e308\n", "valve.stroke_m: allowed is 1e-09 to 1e+06, got 1e+308"),
        ("[valve]\nstroke_m = 0.1\n[pressure]\nmaximum_pa = 1e308\n", "pressure.maximum_pa: allowed is 0.001 to 1e+09"),
        ("[valve]\nstroke_m = 0.1\n[safety]\nstale_after_s = 1e5\n", "safety.stale_after_s: allowed is 1e-06 to 3600"),
        ("[valve]\nname = ''\nstroke_m = 0.1\n", "valve.name: must be printable characters"),
        ("[valve]\nname = 'hold '\nstroke_m = 0.1\n", "valve.name: must be printable characters"),
        ('[valve]\nname = "\\u0000"\nstroke_m = 0.1\n', "valve.name: must be printable characters"),
        ("[valve]\nstroke_m = 0.1\n[cycle]\nshadow = 0\n", "cycle.shadow: Input should be a valid boolean, got 0"),
        ("[valve]\nstroke_m = 0.1\n[device]\nport = true\n", "device.port: Input should be a valid integer, got True"),
        (
            "[valve]\nstroke_m = 0.1\n[supervisory]\nallowed_networks = [1]\n",
            "supervisory.allowed_networks.0: must be the address of a host or a network, got 1",
        ),
        (
            "[valve]\nstroke_m = 0.1\n[device]\nbus = 'rtu'\nserial = {path = 'x', stop_bits = true}\n",
            "device.serial.stop_bits: Input should be a valid integer, got True",
        ),
        (
            "[valve]\nstroke_m = 0.1\n[safety]\naction = 'open'\n",
            "safety.action: Input should be 'hold', 'vent', 'fill' or 'safe'",
        ),
        (
            "[valve]\nstroke_m = 0.1\n[identification]\nwindow_s = 0.1\n",
            "identification: minimum_window_s must be at most window_s (0.1 s)",
        ),
        *(
            (
                f"[valve]\nstroke_m = 0.1\n[{table}]\n{key} = {ends}\n",
                f"{table}.{key}: must be at least 0.2 wide, the lower",
            )
            for table, key in (
                ("excitation", "travel_window"),
                ("excitation", "permitted_travel"),
                ("experiment", "travel_window"),
            )
            for ends in ([0.4, 0.5], [0.9, 0.1])
        ),
        ("[valve]\nstroke_m = 0.1\n[control]\nlaw = 'moves'\n", "control.law: it moved by pulses, and slides where"),
        (
            "[valve]\nstroke_m = 0.1\n[control]\nlaw = 'breakaway'\n",
            'control.law: it moved by pulses, and is gone: "slides" replaces it',
        ),
        (
            "[valve]\nstroke_m = 0.1\n[control]\nlaw = 'pid'\n",
            'control.law: allowed is "conventional" or "seed" or "slides"',
        ),
    ],
)
def test_the_daemon_file_is_held_to_its_schema(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "daemon.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_daemon(path)
    assert str(caught.value).removeprefix(f"{path}: ").startswith(said)


def test_an_error_passes_between_processes() -> None:
    error = InputError("valve.toml", "stroke_m: must be greater than 0")
    passed = pickle.loads(pickle.dumps(error))
    assert (str(passed), passed.source, passed.problem) == (str(error), error.source, error.problem)


def test_of_a_link_every_path_counts_from_where_the_link_is(tmp_path: Path) -> None:
    file, link = tmp_path / "etc" / "daemon.toml", tmp_path / "site" / "daemon.toml"
    for each in (file, link):
        each.parent.mkdir()
    tables = "[valve]\nstroke_m = 0.1\n[law]\nvalve = 'v.toml'\n[recorder]\nfolder = 'r'\n[history]\nfolder = 'h'\n"
    file.write_text(tables)
    link.symlink_to(file)
    law = load_daemon(link).law
    (place,) = places_in([link])
    assert law is not None
    assert [law.valve, place.recordings, place.history] == [link.parent / name for name in ("v.toml", "r", "h")]

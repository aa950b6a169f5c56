"""`positioner valve`: a valve file from what a data sheet says, and what it does not say assumed and told.

    k_s = (p_1 - p_0) A / stroke        F_0 = p_0 A        F_c = 1/2 f (p_1 - p_0) A        F_s = r F_c

p_0, p_1 bench range, Pa; A effective diaphragm area, m^2; f friction, the pressure between opening and closing as a
share of the range; r break-away over sliding friction. m and F_v are no data sheet's: m goes with the
area, F_v is 15 ms k_s.
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from config.valve_file import ValveFile

HELP = "write a valve file from a data sheet: area, bench range and stroke; prints what it assumed beyond that"
EXAMPLE = "positioner valve --area-cm2 700 --range-bar 0.2 1.0 --stroke-mm 40 -o v.toml"

FRICTION_PERCENT = 5.0
BREAKAWAY_RATIO = 1.3
KG_PER_M2 = 8.0 / 0.07
"""Plate, stem and plug: 8 kg go with 700 cm2."""
DAMPING_S = 15e-3
"""F_v/k_s: the air that a diaphragm pushes in and out."""
STRIBECK_M_PER_S = 5e-4
DEADZONE = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("--area-cm2", type=float, required=True, metavar="CM2", help="effective area of the diaphragm")
    parser.add_argument(
        "--range-bar",
        type=float,
        nargs=2,
        required=True,
        metavar=("CLOSED", "OPEN"),
        help="bench range: gauge pressures at which the stem leaves one end and reaches the other",
    )
    parser.add_argument("--stroke-mm", type=float, required=True, metavar="MM", help="rated travel")
    parser.add_argument(
        "--friction-percent",
        type=float,
        metavar="F",
        help=f"pressure between opening and closing, of the range ({FRICTION_PERCENT:g}; PTFE 2-6, graphite 5-15)",
    )
    parser.add_argument(
        "--breakaway-ratio", type=float, metavar="R", help=f"break-away over sliding friction ({BREAKAWAY_RATIO:g})"
    )
    parser.add_argument("--mass-kg", type=float, metavar="KG", help="plate, stem and plug (8 kg at 700 cm2)")
    parser.add_argument("--name", default="from data sheet", help="of the valve")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="V.toml")


def run(arguments: argparse.Namespace) -> int:
    """Write the file and print what it rests on."""
    from config.writing import write_valve
    from positioner.cli.parts.output_files import writable

    writable(arguments.out, "-o")
    _require(arguments)
    file, given, assumed = from_data_sheet(arguments)
    write_valve(arguments.out, file, [*(f"given: {each}" for each in given), *(f"assumed: {each}" for each in assumed)])
    for each in given:
        print(f"from the data sheet: {each}")
    for each in assumed:
        print(f"assumed: {each}")
    print(f"{arguments.out}: written; hold it against a recording: positioner compare REC --valve {arguments.out}")
    return 0


def _require(arguments: argparse.Namespace) -> None:
    """Check the numbers.

    Raises:
        InputError: one is out of its range; says what is allowed.
    """
    from config.errors import InputError

    allowed = {"area_cm2": 1e5, "stroke_mm": 1500.0, "friction_percent": 90.0, "breakaway_ratio": 10.0, "mass_kg": 1e4}
    for key, most in allowed.items():
        value, least = getattr(arguments, key), 1.0 if key == "breakaway_ratio" else 0.0
        inside = value is None or ((value >= 1.0 if key == "breakaway_ratio" else value > 0.0) and value <= most)
        if not inside:
            raise InputError(
                f"--{key.replace('_', '-')}", f"must be above {least:g}, at most {most:g}, it is {value:g}"
            )
    closed, open_ = arguments.range_bar
    if not 0.0 <= closed < open_ <= 20.0:
        raise InputError(
            "--range-bar", f"must be two gauge pressures, the lower first, up to 20 bar; it is {closed:g} {open_:g}"
        )


def from_data_sheet(arguments: argparse.Namespace) -> "tuple[ValveFile, list[str], list[str]]":
    """Return the valve, what it says from the data sheet, and what was assumed."""
    from config.valve_file import EffectTable, ValveFile, ValveParameters

    area_m2, stroke_m = 1e-4 * arguments.area_cm2, 1e-3 * arguments.stroke_mm
    closed_pa, open_pa = (1e5 * each for each in arguments.range_bar)
    span_n = (open_pa - closed_pa) * area_m2
    spring = span_n / stroke_m
    percent = arguments.friction_percent or FRICTION_PERCENT
    ratio = arguments.breakaway_ratio or BREAKAWAY_RATIO
    coulomb_n = 0.5 * percent / 100.0 * span_n
    mass_kg = arguments.mass_kg or KG_PER_M2 * area_m2
    valve = ValveParameters(
        name=arguments.name,
        mass_kg=_rounded(mass_kg),
        diaphragm_area_m2=_rounded(area_m2),
        spring_n_per_m=_rounded(spring),
        viscous_ns_per_m=_rounded(DAMPING_S * spring),
        coulomb_n=_rounded(coulomb_n),
        static_n=_rounded(ratio * coulomb_n),
        stribeck_velocity_m_per_s=STRIBECK_M_PER_S,
        deadzone_ratio=DEADZONE,
        stroke_m=_rounded(stroke_m),
    )
    preload = EffectTable.model_validate({"name": "preload", "force_n": _rounded(closed_pa * area_m2)})
    given = [
        f"spring {valve.spring_n_per_m:g} N/m: {span_n:.6g} N over {arguments.stroke_mm:g} mm",
        f"preload {closed_pa * area_m2:.6g} N: {arguments.range_bar[0]:g} bar on {arguments.area_cm2:g} cm2",
    ]
    friction = f"sliding friction {valve.coulomb_n:g} N: {percent:g} % of the range between opening and closing"
    breakaway = f"break-away friction {valve.static_n:g} N: {ratio:g} times that"
    mass = f"mass {valve.mass_kg:g} kg"
    assumed = [
        *([friction] if arguments.friction_percent is None else []),
        *([breakaway] if arguments.breakaway_ratio is None else []),
        *([f"{mass}: 8 kg go with 700 cm2"] if arguments.mass_kg is None else []),
        f"damping {valve.viscous_ns_per_m:g} N s/m: F_v/k_s = {1e3 * DAMPING_S:g} ms",
        f"Stribeck velocity {STRIBECK_M_PER_S:g} m/s; no stops at the ends of the travel",
    ]
    given += [each for each in (friction, breakaway, mass) if not any(one.startswith(each) for one in assumed)]
    return ValveFile(valve=valve, effect=(preload,) if closed_pa > 0.0 else ()), given, assumed


def _rounded(value: float) -> float:
    """Return a value with the six digits that a data sheet never has."""
    return float(f"{value:.6g}")

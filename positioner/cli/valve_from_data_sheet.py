"""`positioner valve`: a valve file from what a data sheet says (`config.data_sheet`)."""

import argparse
from pathlib import Path

HELP = "write a valve file from a data sheet: area, bench range and stroke; prints what it assumed beyond that"
EXAMPLE = "positioner valve --area-cm2 700 --range-bar 0.2 1.0 --stroke-mm 40 -o v.toml"


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
        help="pressure between opening and closing, of the range (5; PTFE 2-6, graphite 5-15)",
    )
    parser.add_argument("--breakaway-ratio", type=float, metavar="R", help="break-away over sliding friction (1.3)")
    parser.add_argument("--mass-kg", type=float, metavar="KG", help="plate, stem and plug (8 kg at 700 cm2)")
    parser.add_argument("--name", default="from data sheet", help="of the valve")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="V.toml")


def run(arguments: argparse.Namespace) -> int:
    """Write the file and print what it rests on."""
    from config.data_sheet import DataSheet, from_data_sheet
    from config.writing import write_valve
    from positioner.cli.parts.naming import naming
    from positioner.cli.parts.output_files import writable

    writable(arguments.out, "-o")
    keys = ("area_cm2", "range_bar", "stroke_mm", "friction_percent", "breakaway_ratio", "mass_kg", "name")
    with naming({key: f"--{key.replace('_', '-')}" for key in keys}):
        file, given, assumed = from_data_sheet(DataSheet(**{key: getattr(arguments, key) for key in keys}))
    write_valve(arguments.out, file, [*(f"given: {each}" for each in given), *(f"assumed: {each}" for each in assumed)])
    for each in given:
        print(f"from the data sheet: {each}")
    for each in assumed:
        print(f"assumed: {each}")
    print(f"{arguments.out}: written; hold it against a recording: positioner compare REC --valve {arguments.out}")
    return 0

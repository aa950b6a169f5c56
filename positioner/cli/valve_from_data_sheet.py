"""`positioner valve`: a valve file from a data sheet (`config.data_sheet`), or another with values set by hand."""

import argparse
from pathlib import Path

from config.errors import InputError
from positioner.cli.parts.given_names import naming
from positioner.cli.parts.model_arguments import read_valve, require_parameters
from positioner.cli.parts.output_files import writable

HELP = "write a valve file from a data sheet; prints what it assumes"
EXAMPLE = "positioner valve --area-cm2 700 --range-bar 0.2 1.0 --stroke-mm 40 -o v.toml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("--area-cm2", type=float, metavar="CM2", help="effective area of the diaphragm")
    parser.add_argument(
        "--range-bar",
        type=float,
        nargs=2,
        metavar=("FIRST", "LAST"),
        help="bench range: gauge pressures at which the stem leaves one end and reaches the other, for either action",
    )
    parser.add_argument("--stroke-mm", type=float, metavar="MM", help="rated travel")
    parser.add_argument(
        "--friction-percent",
        type=float,
        metavar="F",
        help="pressure difference between opening and closing, %% of the range (5; PTFE 2-6, graphite 5-15)",
    )
    parser.add_argument(
        "--breakaway-ratio", type=float, metavar="R", help="ratio of break-away to sliding friction (1.3)"
    )
    parser.add_argument("--mass-kg", type=float, metavar="KG", help="mass of plate, stem and plug (8 at 700 cm2)")
    parser.add_argument("--name", default="from data sheet", help="name of the valve")
    parser.add_argument("--of", metavar="VALVE.toml", help="begin with this valve file, or a shipped valve")
    parser.add_argument(
        "--set",
        nargs="+",
        default=[],
        metavar="NAME=VALUE",
        help="with --of: change a parameter (SI units), as coulomb_n=1300 or preload.force_n=467",
    )
    parser.add_argument("--without", nargs="+", default=[], metavar="EFFECT", help="with --of: leave these effects out")
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="V.toml", help="the valve file")


def run(arguments: argparse.Namespace) -> int:
    """Write the file and print what it rests on."""

    writable(arguments.out, "-o")
    sheet = {key: getattr(arguments, key) for key in SHEET}
    if arguments.of is not None:
        if given := [key for key, value in sheet.items() if value is not None]:
            raise InputError(_option(given[0]), "describes a data sheet, so --of must not be given")
        return _change_file(arguments)
    if missing := [key for key in REQUIRED if sheet[key] is None]:
        raise InputError(_option(missing[0]), "is needed for a data sheet; --of VALVE.toml changes another valve")
    if arguments.set or arguments.without:
        raise InputError("--set" if arguments.set else "--without", "needs --of VALVE.toml, the valve that is changed")
    return _from_data_sheet(arguments)


REQUIRED = ("area_cm2", "range_bar", "stroke_mm")
SHEET = (*REQUIRED, "friction_percent", "breakaway_ratio", "mass_kg")


def _option(key: str) -> str:
    return f"--{key.replace('_', '-')}"


def _change_file(arguments: argparse.Namespace) -> int:
    from config.valve_changes import change_valve, changes_in_words
    from config.valve_file_writer import write_valve

    values = dict(map(_read_assignment, arguments.set))
    file = change_valve(read_valve(arguments.of), values, arguments.without)
    require_parameters(file, "--set")
    said = changes_in_words(values, arguments.without)
    write_valve(arguments.out, file, [f"{arguments.of} with {each}" for each in said])
    print(f"{arguments.out}: {arguments.of} with {', '.join(said) or 'nothing changed'}")
    return 0


def _read_assignment(text: str) -> tuple[str, float]:
    """Return name and value.

    Raises:
        InputError: it is no assignment of a number.
    """

    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError:
        raise InputError("--set", f"must be NAME=VALUE, as coulomb_n=1300, got {text!r}") from None


def _from_data_sheet(arguments: argparse.Namespace) -> int:
    from config.data_sheet import DataSheet, from_data_sheet
    from config.valve_file_writer import write_valve

    keys = (*SHEET, "name")
    with naming({key: _option(key) for key in keys}):
        file, given, assumed = from_data_sheet(DataSheet(**{key: getattr(arguments, key) for key in keys}))
    write_valve(arguments.out, file, [*(f"given: {each}" for each in given), *(f"assumed: {each}" for each in assumed)])
    for each in given:
        print(f"from the data sheet: {each}")
    for each in assumed:
        print(f"assumed: {each}")
    print(f"{arguments.out}: written; compare it with a recording: positioner compare REC --valve {arguments.out}")
    return 0

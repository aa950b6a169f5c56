"""`positioner export fmu`: a valve file as a unit for other simulators."""

import argparse
from pathlib import Path

from config.file_kinds import VALVE_SAID
from positioner.cli.parts.output_files import writable
from positioner.cli.parts.progress import at_work

HELP = "write a valve for other simulators, as an FMU (FMI 2.0, co-simulation)"
EXAMPLE = "positioner export fmu seed -o valve.fmu"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("format", choices=["fmu"], help="the format")
    parser.add_argument("valve", metavar="VALVE.toml", help=VALVE_SAID)
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="VALVE.fmu", help="the FMU")


def run(arguments: argparse.Namespace) -> int:
    """Write it, and say what goes in and comes out."""
    from config.valve_file import find_valve, load_valve, valve_alone
    from sim.composition import Composition
    from sim.fmu.fmu_file import export_fmu
    from sim.fmu.model_description import variables

    writable(arguments.out, "-o")
    path = find_valve(arguments.valve)
    valve = valve_alone(load_valve(path), str(path), "an FMU here has pressures and positions, Pa and m")
    composition = Composition.from_file(valve, str(path))
    with at_work("export", f"compiling {arguments.valve}"):
        export_fmu(composition, arguments.out)
    by_causality = {"input": "in", "output": "out"}
    told = [
        f"{by_causality[each.causality]} {each.name}"
        for each in variables(composition)
        if each.causality in by_causality
    ]
    print(
        f"{arguments.out}: FMI 2.0 co-simulation, Linux x86-64; {', '.join(told)}; {composition.theta.size} parameters"
    )
    return 0

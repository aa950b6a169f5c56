"""`positioner simulate`: an open-loop recording from the model, no bus."""

import argparse
from pathlib import Path

from config.file_kinds import VALVE_SAID
from positioner.cli.parts.given_names import naming
from positioner.cli.parts.model_arguments import read_valve
from positioner.cli.parts.output_files import recording_writable
from positioner.cli.parts.progress import at_work

HELP = "simulate the stem under a series of pressures, without a controller"
EXAMPLE = "positioner simulate seed.toml --input pressure.csv --noise-m 1e-5 -o answer.csv"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("valve", metavar="VALVE.toml", help=VALVE_SAID)
    parser.add_argument(
        "--input",
        type=Path,
        required=True,
        metavar="PRESSURE.csv",
        help="columns time_s and command_pa (of a valve with a positioner reference_m); each row holds until the next",
    )
    parser.add_argument("-o", "--out", type=Path, required=True, metavar="REC.csv", help="the recording")
    parser.add_argument("--noise-m", type=float, default=0.0, help="standard deviation of the sensor's noise")
    parser.add_argument("--seed", type=int, default=0, help="seed of the noise")


def run(arguments: argparse.Namespace) -> int:
    """Simulate from rest at position 0 without pressure, and write the recording."""
    from config.valve_file import find_valve
    from positioner.cli.parts.csv_series import read_series
    from sim.effect import find_effect
    from sim.simulation import simulate

    recording_writable(arguments.out, "-o")
    path = find_valve(arguments.valve)
    valve = read_valve(arguments.valve)
    by_setpoint = any(find_effect(each.name, str(path)).by_setpoint for each in valve.effect)
    asked = valve.valve.own.own("reference_m" if by_setpoint else "command_pa")
    time_s, command_pa = read_series(arguments.input, asked)
    what = f"simulating {time_s[-1] - time_s[0]:g} s"
    with naming({"valve file": str(path), "sensor": "--noise-m, --seed"}), at_work("simulate", what):
        recording = simulate(valve, time_s, command_pa, noise_std_m=arguments.noise_m, seed=arguments.seed)
    recording.write(arguments.out)
    print(f"{arguments.out}: {len(recording)} samples, {time_s[-1] - time_s[0]:g} s")
    return 0

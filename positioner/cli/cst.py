"""`positioner cst`: the continuous stroke test, break-away friction of a valve in operation."""

import argparse

from positioner.cli.parts.valve_test import add_test_arguments, bounds_of, checked, finished, played_all, playing

HELP = "test: break-away friction in operation; the command creeps until the stem moves, then returns (moves the valve)"
EXAMPLE = "positioner cst site.toml --rate 0.0005"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_test_arguments(parser, recordings=False)
    parser.add_argument(
        "--start", type=float, default=0.003, metavar="SHARE", help="travel that ends the creep, share of the stroke"
    )
    parser.add_argument("--most", type=float, default=0.02, metavar="SHARE", help="travel that stops the test")
    parser.add_argument(
        "--rate", type=float, default=5e-4, metavar="PER_S", help="rate of the command, share of its range a second"
    )


def run(arguments: argparse.Namespace) -> int:
    """Creep up and down; print what friction is; 0 if it passed, else 1."""
    from positioner.cli.parts.experiment_player import RunningValve, require_ready
    from positioner.tests_on_the_valve.continuous_stroke import TEST, ContinuousStroke, continuous_stroke, programme

    file = checked(arguments)
    assert file is not None
    asked = ContinuousStroke(arguments.start, arguments.most, arguments.rate)
    asked.require_possible()
    require_ready(file, arguments)
    valve, bounds, stroke_m = RunningValve(file, arguments), bounds_of(file), file.valve.stroke_m
    dead_band_pa, ways = valve.dead_band_pa(), (1, -1)
    programs = (programme(asked, bounds, valve.command_pa(), stroke_m, way, dead_band_pa) for way in ways)
    with playing(TEST, file, arguments):
        played = played_all(valve, programs, len(ways))
    outcome = continuous_stroke(played, asked, file.valve.name, stroke_m, valve.slope_pa_per_m())
    return finished(outcome, file, arguments)

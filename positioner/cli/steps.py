"""`positioner steps`: dead band, resolution and step response of a running valve, by small steps of its command."""

import argparse

from config.errors import CommandFailed, InputError
from positioner.cli.parts.valve_test import (
    add_test_arguments,
    bounds_of,
    checked,
    finished,
    played_all,
    playing,
    recordings_of,
)

HELP = "test: dead band, resolution and step response, by small steps (moves the valve)"
EXAMPLE = "positioner steps site.toml --held-s 2"

AT_AN_END = 0.05
"""Of the stroke: a stem so near an end may be pressed onto it."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_test_arguments(parser, recordings=False)
    parser.add_argument(
        "--dead-band-pa", type=float, metavar="PA", help="expected dead band (twice the known friction)"
    )
    parser.add_argument("--held-s", type=float, default=0.8, metavar="S", help="duration of each step")
    parser.add_argument(
        "--most", type=float, default=0.3, metavar="SHARE", help="travel that stops the test, share of the stroke"
    )


def run(arguments: argparse.Namespace) -> int:
    """Step, print dead band, resolution and times; 0 if both are bracketed, else 1."""
    from positioner.cli.parts.experiment_player import RunningValve, require_ready
    from positioner.tests_on_the_valve.small_steps import TEST, SmallSteps, programme, small_steps

    file = checked(arguments)
    assert file is not None
    require_ready(file, arguments)
    valve = RunningValve(file, arguments)
    expected_pa = arguments.dead_band_pa or valve.dead_band_pa()
    if expected_pa is None:
        raise InputError("--dead-band-pa", "is required while the valve is not identified")
    if not AT_AN_END < valve.stem_m() / file.valve.stroke_m < 1.0 - AT_AN_END:
        raise CommandFailed("the stem is at an end, where steps move nothing: positioner set reference 0.5")
    asked = SmallSteps(expected_pa, arguments.held_s, arguments.most)
    program = programme(asked, bounds_of(file), valve.command_pa(), file.valve.stroke_m, str(arguments.config))
    with playing(TEST, file, arguments):
        (recording,) = recordings_of(played_all(valve, (program,), 1))
    outcome = small_steps(recording, file.valve.name, file.valve.stroke_m, valve.slope_pa_per_m())
    return finished(outcome, file, arguments)

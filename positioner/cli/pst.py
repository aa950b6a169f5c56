"""`positioner pst`: the partial stroke test of a running valve, kept and trended, with the credit that it may claim."""

import argparse
from typing import TYPE_CHECKING

from positioner.cli.parts.valve_test import (
    add_test_arguments,
    bounds_of,
    checked,
    finished,
    playing,
    reference_of,
    trend_of,
)

if TYPE_CHECKING:
    from positioner.tests_on_the_valve.credit import Credit
    from positioner.tests_on_the_valve.partial_stroke import PartialStroke

HELP = "test: a partial stroke, with break-out, friction and times against a reference (moves the valve)"
EXAMPLE = "positioner pst site.toml --travel 0.1 --against as_left"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_test_arguments(parser, recordings=False)
    _add_share(parser, "--travel", 0.1, "travel of the test, share of the stroke")
    _add_share(parser, "--beyond", 0.05, "travel beyond --travel that ends the test")
    _add_share(parser, "--least", None, "least travel to pass (0.8 of --travel)")
    _add_share(parser, "--start", 0.005, "travel that counts as break-out")
    parser.add_argument("--towards", choices=("open", "closed"), help="direction (away from the nearer end)")
    parser.add_argument("--step", action="store_true", help="step at the rate limit in place of a ramp")
    parser.add_argument(
        "--threshold-pa",
        type=float,
        metavar="PA",
        help="pressure beyond which the command is not taken (the limit of [experiment])",
    )
    parser.add_argument(
        "--failure-rate-per-h",
        type=float,
        metavar="RATE",
        help="dangerous undetected failures; prints PFD_avg with and without the test",
    )
    _add_share(parser, "--partial-coverage", 0.6, "share of these failures that the partial stroke shows")
    _add_share(parser, "--proof-coverage", 0.9, "share of these failures that the proof test shows")
    parser.add_argument(
        "--every-days", type=float, default=30.0, metavar="DAYS", help="interval of the partial stroke test"
    )
    parser.add_argument(
        "--proof-every-years", type=float, default=5.0, metavar="YEARS", help="interval of the proof test"
    )
    parser.add_argument("--life-years", type=float, default=20.0, metavar="YEARS", help="life of the valve")


def _add_share(parser: argparse.ArgumentParser, option: str, default: float | None, text: str) -> None:
    parser.add_argument(option, type=float, default=default, metavar="SHARE", help=text)


def run(arguments: argparse.Namespace) -> int:
    """Test, keep, print verdict, figures and trend; 0 if it passed, else 1."""
    from positioner.cli.parts.experiment_player import RunningValve, require_ready
    from positioner.tests_on_the_valve.partial_stroke import TEST, partial_stroke, programme

    file = checked(arguments)
    assert file is not None
    asked, credit = _read_partial_stroke(arguments, file.valve.travel.closes), _credit(arguments)
    require_ready(file, arguments)
    valve, stroke_m = RunningValve(file, arguments), file.valve.stroke_m
    program = programme(asked, bounds_of(file), valve.command_pa(), valve.stem_m(), stroke_m, str(arguments.config))
    reference = reference_of(TEST, file, arguments)
    with playing(TEST, file, arguments):
        played = valve.play(program)
    limits = (file.health.friction_low, file.health.friction_high)
    outcome = partial_stroke(
        played, asked, file.valve.name, stroke_m, None if reference is None else reference.outcome, limits
    )
    status = finished(outcome, file, arguments, always_kept=True, compared=False)
    print(trend_of(TEST, ("breakout_pa", "reached_m", "stroke_s"), file, arguments))
    if credit is not None:
        print("\n".join(credit.lines() if outcome.passed else ["it did not pass: no credit may be claimed"]))
    return status


def _read_partial_stroke(arguments: argparse.Namespace, closes: bool) -> "PartialStroke":
    from positioner.tests_on_the_valve.partial_stroke import PartialStroke

    more_air = None if arguments.towards is None else (arguments.towards == "open") is not closes
    least = 0.8 * arguments.travel if arguments.least is None else arguments.least
    asked = PartialStroke(
        arguments.travel, arguments.beyond, least, arguments.start, more_air, arguments.step, arguments.threshold_pa
    )
    asked.require_possible()
    return asked


def _credit(arguments: argparse.Namespace) -> "Credit | None":
    from positioner.tests_on_the_valve.credit import DAYS_A_YEAR, Credit

    if arguments.failure_rate_per_h is None:
        return None
    credit = Credit(
        arguments.failure_rate_per_h,
        arguments.partial_coverage,
        arguments.proof_coverage,
        arguments.every_days / DAYS_A_YEAR,
        arguments.proof_every_years,
        arguments.life_years,
    )
    credit.require_possible()
    return credit

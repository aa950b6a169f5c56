"""`positioner health`: how a running valve is, and how it was used, day by day."""

import argparse
import datetime
import json
from typing import TYPE_CHECKING

from config.registers import BY_NAME
from positioner.cli.parts.daemon_address import add_connection, connect_dcs

if TYPE_CHECKING:
    from positioner.daemon.health.daily_figures import OperationDay

HELP = "print NE 107 status, wear and today's figures of a valve; with --config also those of earlier days"
EXAMPLE = "positioner health --config daemon.toml"

FIGURES = (
    *("ne107", "ne107_cause", "friction_ratio", "travel", "reversals", "stiction_index"),
    *("away_mean", "saturated", "course_deviation", "pressure_short", "supply_short"),
    *("end_closed", "end_trend", "exhausted", "dead_band"),
)
BAR = 40
"""Characters of a whole histogram."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    add_connection(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print it."""

    from config.json_value import json_value
    from northbound.observer.register_words import in_words

    days = _days(arguments)
    with connect_dcs(arguments) as dcs:
        values = dcs.get_all(*FIGURES)
    if arguments.json:
        print(json.dumps(json_value({**values, "days": [each.model_dump() for each in days]})))
        return 0
    for name, value in values.items():
        words = in_words(name, value, values) or BY_NAME[name].text
        print(f"{name:18} {value:<12.6g} {words}")
    for day in days:
        print_day(day)
    return 0


def _days(arguments: argparse.Namespace) -> "tuple[OperationDay, ...]":
    """Return the days that the daemon keeps; none without its file."""
    from config.daemon_file import load_daemon
    from positioner.daemon.health.health_file import kept_days
    from positioner.daemon.sole_daemon import HEALTH, valve_file_path

    if arguments.config is None:
        return ()
    file = load_daemon(arguments.config, arguments.valve)
    if file.health.folder is None:
        return ()
    return kept_days(
        valve_file_path(arguments.config.parent / file.health.folder, file.valve.name, HEALTH), file.valve.name
    )


def print_day(day: "OperationDay") -> None:
    """Print a day: a line, and its histograms."""

    from positioner.daemon.health.daily_figures import DAY_S, DEVIATIONS, OPENINGS
    from positioner.daemon.health.travel_accumulator import SPANS

    date = datetime.datetime.fromtimestamp(day.day * DAY_S, datetime.UTC).date()
    print(f"\n{date}  {day.seconds / 3600:.1f} h, {day.exhausted:.3g} volumes of air, {day.saturated} s at a limit")
    for title, edges, counts in (
        ("opening", OPENINGS, day.opening),
        ("deviation", DEVIATIONS, day.deviation),
        ("cycle span", SPANS, day.span),
    ):
        total = sum(counts)
        for number, count in enumerate(counts):
            if count:
                below = f"< {100 * edges[number]:g} %" if number < len(edges) else f"> {100 * edges[-1]:g} %"
                print(f"  {title:10} {below:>9} {count:>8} {'#' * round(BAR * count / total)}")

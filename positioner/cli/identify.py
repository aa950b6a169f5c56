"""`positioner identify`: has the daemon identify its valve, as a DCS would: eta = 0, wait, eta = 1."""

import argparse
from typing import TYPE_CHECKING

from config.codes import Ne107Cause, Refusal, Sampling
from config.errors import CommandFailed
from config.registers import BY_NAME, ESTIMATED
from positioner.cli.parts.daemon_address import add_connection, connect_dcs

if TYPE_CHECKING:
    from positioner.dcs import Dcs

HELP = (
    "measure spring and friction of the valve; moves it up and down inside [excitation] travel_window, "
    "for seconds to minutes; the mode must be automatic"
)
EXAMPLE = "positioner identify   # after `positioner set mode automatic`"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument(
        "--alpha-pa",
        type=float,
        help="only for [excitation] kind sine: mean pressure; 0: the pressure that holds the stem",
    )
    parser.add_argument("--beta-pa", type=float, help="only for a sine: amplitude")
    parser.add_argument("--omega-rad-per-s", type=float, help="only for a sine: angular frequency")
    parser.add_argument("--timeout-s", type=float, default=600.0, help="give up after this many seconds")
    add_connection(parser)


def run(arguments: argparse.Namespace) -> int:
    """Identify, print what was found, and whether the law uses it now."""
    from northbound.observer.identify_permissives import IDENTIFY_READS, identify_permissives

    asked = {
        "alpha": arguments.alpha_pa,
        "beta": arguments.beta_pa,
        "omega": arguments.omega_rad_per_s,
    }
    with connect_dcs(arguments) as dcs:
        for permissive in identify_permissives(dcs.get_all(*IDENTIFY_READS)):
            if not permissive.holds:
                raise CommandFailed(permissive.remedy)
        excitation = {name: value for name, value in asked.items() if value is not None}
        return _report(dcs, dcs.identify(excitation, arguments.timeout_s))


def _report(dcs: "Dcs", problem: str | None) -> int:
    from positioner.estimation.estimates import refusals_said

    reasons = {}
    print(f"{'':12} {'estimate':>14} {'std':>12} unit")
    for name in (*ESTIMATED, "static_slope", "static_up", "static_down"):
        now = dcs.get_all(f"{name}_e", f"{name}_std", f"{name}_reason")
        reasons[name] = Refusal(int(now[f"{name}_reason"]))
        if reasons[name] is Refusal.VALID:
            print(f"{name:12} {now[f'{name}_e']:14.6g} {now[f'{name}_std']:12.3g} {BY_NAME[f'{name}_e'].unit}")
    print(*refusals_said(reasons), sep="\n")
    if problem is not None:
        print(f"\nnot applied: {problem}; the law keeps what it had")
        return 1
    law = dcs.get_all("b_over_c_applied", "k_over_c_applied", "offset_applied", "sampling", "ne107_causes_high")
    if law["sampling"]:
        print(f"\n[device] sampling, as found: {Sampling(int(law['sampling'])).text}")
    if int(law["ne107_causes_high"]) >> (Ne107Cause.ONE_DIRECTION - 17) & 1:
        print("\none direction is identified: k/c holds for it alone until the stem has moved the other way")
    print("\napplied. [memory] folder in the daemon's file keeps it over a restart; without it, copy into that file:")
    by_landings = "       # minus static_slope" if reasons["static_slope"] is Refusal.VALID else ""
    print(f"[law]\nb_over_c_pa_per_m = {law['b_over_c_applied']:.7g}{by_landings}")
    print(f"k_over_c_pa = {law['k_over_c_applied']:.7g}")
    if law["offset_applied"]:
        print(f"offset_pa = {law['offset_applied']:.7g}")
    return 0

"""`positioner identify`: has the daemon identify its valve, as a DCS would: eta = 0, wait, eta = 1."""

import argparse
from typing import TYPE_CHECKING

from positioner.cli.connection import add_connection, connected

if TYPE_CHECKING:
    from positioner.dcs import Dcs

HELP = "identify the valve (moves it: state S3); the mode must be automatic"
EXAMPLE = "positioner identify --alpha-pa 44126 --beta-pa 13238"

POLL_S = 0.05


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("--alpha-pa", type=float, help="constant part of the excitation, Pa; 0 keeps the stem")
    parser.add_argument("--beta-pa", type=float, help="amplitude of its sine, Pa")
    parser.add_argument("--omega-rad-per-s", type=float, help="angular frequency of its sine, rad/s")
    parser.add_argument("--timeout-s", type=float, default=10.0, help="give up after this many seconds (10)")
    add_connection(parser)


def run(arguments: argparse.Namespace) -> int:
    """Identify, print what was found, and whether the law uses it now."""
    from config.registers import Mode
    from positioner.dcs import DcsError

    asked = {
        "alpha": arguments.alpha_pa,
        "beta": arguments.beta_pa,
        "omega": arguments.omega_rad_per_s,
    }
    with connected(arguments) as dcs:
        if dcs.get("mode") != Mode.AUTOMATIC:
            raise DcsError("the mode is not automatic, so nothing may move the valve: positioner set mode automatic")
        dcs.set_all({name: value for name, value in asked.items() if value is not None})
        before = dcs.get("identifications")
        try:
            dcs.set_all({"eta_1": 0, "eta_2": 0, "eta_3": 0})
            problem = wait(dcs, arguments.timeout_s)
        finally:
            dcs.set_all({"eta_1": 1, "eta_2": 1, "eta_3": 1})
        return _report(dcs, before, problem)


def wait(dcs: "Dcs", timeout_s: float) -> str | None:
    """Wait until the estimates the law needs are there; return what went wrong, or None."""
    import time

    from config.registers import Fault, Why

    due_s = time.monotonic() + timeout_s
    begun = False
    while time.monotonic() < due_s:
        now = dcs.get_all("state", "fault", "why", "progress", "b_over_c_valid", "k_over_c_valid")
        begun = begun or now["state"] == 3
        if now["fault"]:
            return f"fault: {Fault(int(now['fault'])).name.lower().replace('_', ' ')}"
        if now["why"]:
            return Why(int(now["why"])).name.lower().replace("_", " ")
        if begun and now["progress"] >= 1 and now["b_over_c_valid"] and now["k_over_c_valid"]:
            return None
        time.sleep(POLL_S)
    return f"no valid estimates within {timeout_s:g} s"


def _report(dcs: "Dcs", before: float, problem: str | None) -> int:
    import time

    from config.registers import BY_NAME, ESTIMATED
    from positioner.estimation.estimate import Reason

    time.sleep(POLL_S)
    print(f"{'':9} {'estimate':>14} {'std':>12} unit")
    for name in ESTIMATED:
        now = dcs.get_all(f"{name}_e", f"{name}_std", f"{name}_reason")
        reason = Reason(int(now[f"{name}_reason"]))
        note = "" if reason is Reason.VALID else f"  refused: {reason.sentence}"
        unit = BY_NAME[f"{name}_e"].unit
        print(f"{name:9} {now[f'{name}_e']:14.6g} {now[f'{name}_std']:12.3g} {unit}{note}")
    applied = dcs.get("identifications") != before
    if applied:
        law = dcs.get_all("b_over_c_applied", "k_over_c_applied")
        print("\napplied; to keep it over a restart, write into the daemon's file:")
        print(f"[law]\nb_over_c_pa_per_m = {law['b_over_c_applied']:.7g}")
        print(f"k_over_c_pa = {law['k_over_c_applied']:.7g}")
    else:
        print(f"\nnot applied: {problem or 'refused'}; the law keeps what it had")
    return 0 if applied else 1

"""`positioner hide`: recordings with a sealed hidden effect, and the answer afterwards."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from config.errors import InputError
from positioner.cli.parts.progress import at_work

HELP = "make recordings of a valve with a hidden effect, to practise; --reveal prints the answer"
EXAMPLE = "positioner hide --seed 7 -o blind && positioner diagnose blind/fit.csv --valve blind/valve.toml"

LEAST_SAMPLES = 1000  # fewer do not show one of each effect


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    parser.add_argument("--seed", type=int, metavar="N", help="seed of the random valve")
    parser.add_argument(
        "-o", "--out", type=Path, metavar="DIR", help="folder for fit.csv, test.csv, valve.toml and sealed.json"
    )
    parser.add_argument("--effects", type=int, choices=(0, 1, 2), default=1, help="how many effects are hidden")
    parser.add_argument(
        "--dirty",
        action="store_true",
        help="with pressure noise, scattered break-away and a 12-bit transmitter",
    )
    parser.add_argument("--duration-s", type=float, default=30.0, help="length of each recording")
    parser.add_argument("--period-s", type=float, default=0.01, help="time between samples")
    parser.add_argument(
        "--reveal", type=Path, metavar="DIR", help="print the answer of a folder, after a check of its seal"
    )


def run(arguments: argparse.Namespace) -> int:
    """Hide, or reveal."""
    from workbench.blind.hiding import hide
    from workbench.blind.sealing import reveal, seal

    if arguments.reveal is not None:
        sha256, answer = reveal(arguments.reveal)
        _print_answer(sha256, answer)
        return 0
    _check(arguments)
    with at_work("hide", "drawing a valve and simulating it"):
        hidden = hide(
            arguments.seed,
            effects=arguments.effects,
            dirty=arguments.dirty,
            duration_s=arguments.duration_s,
            period_s=arguments.period_s,
        )
    folder = arguments.out
    print(f"sealed: SHA-256 {seal(folder, hidden)}")
    print(f"{folder}/fit.csv, {folder}/test.csv: {len(hidden.fit)} samples each, {arguments.duration_s:g} s")
    print(f"{folder}/valve.toml: what is known of the valve")
    print(f"the answer: positioner hide --reveal {folder}")
    return 0


def _check(arguments: argparse.Namespace) -> None:

    if arguments.seed is None:
        raise InputError("--seed", "is needed: a whole number, 0 or more, the seed of the random valve")
    if arguments.seed < 0:
        raise InputError("--seed", f"must be a whole number, 0 or more, got {arguments.seed}")
    if arguments.out is None:
        raise InputError("-o", "must name the folder in which to hide")
    if not 1e-4 <= arguments.period_s <= 1.0:
        raise InputError("--period-s", f"must lie between 1e-4 and 1 s, got {arguments.period_s:g}")
    if not LEAST_SAMPLES * arguments.period_s <= arguments.duration_s <= 3600.0:
        least_s = LEAST_SAMPLES * arguments.period_s
        raise InputError("--duration-s", f"must lie between {least_s:g} and 3600 s, got {arguments.duration_s:g}")


def _print_answer(sha256: str, answer: Mapping[str, Any]) -> None:
    print(f"the seal holds: SHA-256 {sha256}")
    if not answer["effects"]:
        print("hidden: nothing")
    for effect in answer["effects"]:
        print(f"hidden: {_list_values(effect)}")
        seen = answer["visible"][effect["name"]]
        is_visible = "visible" if seen["is_visible"] else "not visible"
        print(
            f"  {is_visible}: without it, refitted, the valve misses fit.csv by {1e3 * seen['fit_m']:.3g} mm rms "
            f"and test.csv by {1e3 * seen['test_m']:.3g} mm"
        )
    floor = answer["floor_m"]
    print(f"floor: {1e3 * floor['fit']:.3g} mm and {1e3 * floor['test']:.3g} mm rms, the error of the true valve")
    print(f"valve: {_list_values(answer['valve'])}")


def _list_values(table: Mapping[str, Any]) -> str:
    rest = (f"{key} = {value:.4g}" for key, value in table.items() if key != "name")
    return ", ".join([str(table["name"]), *rest])

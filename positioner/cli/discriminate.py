"""`positioner discriminate`: where a diagnosis ends `one_of`, experiments on the running valve tell rivals apart."""

import argparse
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from config.errors import InputError
from config.file_kinds import VALVE_SAID
from positioner.cli.parts.breaking_off import end_as_by_ctrl_c, tell_when_broken_off
from positioner.cli.parts.config_argument import add_config, config_file
from positioner.cli.parts.daemon_address import add_tls
from positioner.cli.parts.fit_arguments import add_pressure, add_test
from positioner.cli.parts.given_names import naming
from positioner.cli.parts.model_arguments import read_valve, require_effects
from positioner.cli.parts.output_files import make_folder, write_json
from positioner.cli.parts.progress import Progress

if TYPE_CHECKING:
    from config.daemon_file import DaemonFile
    from config.experiment_limits import ExperimentLimits
    from workbench.discriminate.discrimination import Played, Player, Round
    from workbench.discriminate.experiment_design import DesignedExperiment

HELP = "diagnose, then play experiments until one of several equally good effects is left (moves the valve)"
EXAMPLE = "positioner discriminate site.toml --rec rec.csv --valve better.toml --out experiments"

EXPERIMENT = "experiment-{}.csv"
BROKEN_OFF = "nothing is named; what was played is in"
WINDOW_MARGIN = 0.03
"""Of the stroke: a design keeps so far inside the travel window, as it knows the stem by its models only."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line."""
    add_config(parser, text="the running daemon's file, with [recorder]")
    parser.add_argument("--rec", type=Path, nargs="+", required=True, metavar="REC", help="recordings, CSV or Parquet")
    parser.add_argument("--valve", required=True, metavar="VALVE.toml", help=VALVE_SAID)
    add_test(parser)
    parser.add_argument("--effects", nargs="+", metavar="NAME", help="effects to try (all known effects)")
    add_pressure(parser)
    parser.add_argument("--budget", type=int, default=60, metavar="MOVES", help="largest number of moves")
    parser.add_argument("--out", type=Path, default=Path("discriminated"), help="folder for recordings and verdict")
    parser.add_argument("--name", help="the valve's name, where the file has several")
    add_tls(parser, ", with a certificate of role engineer")
    parser.add_argument("--seed", type=int, default=0, help="seed of the experiments")


def run(arguments: argparse.Namespace) -> int:
    """Diagnose, play, print a line a round; 0 if nothing is left to be told apart, else 1."""
    from config.daemon_file import load_daemon
    from config.recording import Recording
    from positioner.cli.parts.experiment_player import player_on, require_ready
    from sim.effect import find_effect, tried_effects
    from workbench.diagnosis.diagnosis import diagnose
    from workbench.discriminate.discrimination import discriminate, rivals_of

    path = config_file(arguments)
    file = load_daemon(path, arguments.name)
    bounds = _bounds(file, path)
    require_ready(file, arguments)
    valve = read_valve(arguments.valve)
    require_effects(arguments.effects, "--effects")
    recordings = [Recording.read(path) for path in arguments.rec]
    test = Recording.read(arguments.test) if arguments.test else None
    make_folder(arguments.out)
    named = {"recording": ", ".join(map(str, arguments.rec)), "valve file": arguments.valve}
    with naming(named), Progress() as progress:
        found = diagnose(
            recordings,
            valve,
            test=test,
            effects=arguments.effects,
            progress=progress,
            from_pressure=arguments.from_pressure,
        )
    print(found.sentence, flush=True)
    fits = rivals_of(found)
    if found.verdict != "one_of":
        print("there is one candidate: nothing was played")
        return 0 if found.verdict in ("adequate", "missing") else 1
    effects = [find_effect(name, "effects") for name in arguments.effects or tried_effects()]
    broken_off = tell_when_broken_off("discriminate", lambda: f"{BROKEN_OFF} {arguments.out}")
    with broken_off, end_as_by_ctrl_c(), Progress() as progress:
        told = discriminate(
            fits,
            [*recordings, test] if test else recordings,
            _keep_recordings(player_on(file, arguments), arguments.out),
            bounds,
            {each.written: each for each in effects},
            budget=arguments.budget,
            seed=arguments.seed,
            on_round=_tell,
            progress=progress,
        )
    write_json(arguments.out / "verdict.json", told.as_json(), indent=1)
    print(told.summary())
    if told.outcome == "budget_spent":
        print(f"to go on, give the same command with {arguments.out}/{EXPERIMENT.format('*')} among --rec")
    return 0 if told.outcome in ("resolved", "one_class") else 1


def _bounds(file: "DaemonFile", config: Path) -> "ExperimentLimits":
    """Return what designs must stay inside: the daemon's permissives, and room for the approach.

    Raises:
        InputError: no room is left.
    """
    from positioner.control.settings import Settings

    limits = Settings.of(file).experiment
    approach_s = (limits.maximum_pa - limits.minimum_pa) / limits.rate_pa_per_s
    margin_m = WINDOW_MARGIN * file.valve.stroke_m
    if limits.longest_s <= 3.0 * approach_s:
        raise InputError(
            str(config),
            f"experiment.limit_s must exceed {3.0 * approach_s:.3g} s, three times the way through the pressures at "
            f"rate_limit_pa_per_s, got {limits.longest_s:g} s",
        )
    return replace(
        limits,
        longest_s=limits.longest_s - approach_s,
        low_m=limits.low_m + margin_m,
        high_m=limits.high_m - margin_m,
    )


def _tell(each: "Round") -> None:
    odds = ", ".join(f"{name} {value:.2g}" for name, value in each.odds.items())
    print(f"{each.moves} moves: {each.name}, separation {each.separation:.3g}; odds {odds}", flush=True)


def _keep_recordings(player: "Player", folder: Path) -> "Player":
    """Return it so that each recording is written before anything is made of it, whatever becomes of the rest.

    Beside those of an earlier run, which no valve plays again.
    """

    def play(chosen: "DesignedExperiment") -> "Played":
        played = player(chosen)
        if played.recording is not None:
            files = (folder / EXPERIMENT.format(number) for number in count(1))
            played.recording.write(next(file for file in files if not file.exists()))
        return played

    return play

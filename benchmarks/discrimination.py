"""Sealed valves whose diagnosis ended `one_of`: do experiments tell the rivals apart, and in how many moves?

    python -m benchmarks.discrimination [--family clean dirty] [--cases 20] [--seeds 37157 ...] [--how designed menu]
                                        [--without-pressure] [--out FILE]

The cases are those of the kept blind campaign (`benchmarks.blind`) whose diagnosis against the whole library ended in
one set with more than one class, the hidden effect visible: the same seeds make the same valves, and the rivals are the
set that was named then, fitted anew to both recordings. The valve answers as `workbench.blind.trial` has it, dirty ones
with pressure noise, break-away jitter and 12 bits; the hidden effect is looked at after the last round.

A positioner's slave serves the pressure in its actuator, and a diagnosis that has it drops what it speaks against: so
are rivals dropped here. Where one class is left, nothing is played. With `--without-pressure` nothing of it is known.

Each case is played twice: by experiments designed for the rivals, and by whole inputs of the menu, chosen anew in
every round as a diagnosis chooses. Odds, permissives and the rule that stops are the same; the menu may use
`MENU_BUDGET` moves. A line of JSON is kept a case, so that a run can be broken off and taken up again.
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.blind import KEPT
from benchmarks.kept_lines import Line, keep, kept
from config.experiment_limits import ExperimentLimits
from config.recording import Recording
from config.slave_file import Sensor
from sim.composition import Composition
from sim.effect import shipped_effect, shipped_effects
from workbench.blind.hiding import Hidden, hide
from workbench.blind.trial import LEVELS, NOISE_M, Trial
from workbench.data.held_out import join_recordings, split
from workbench.data.record import ready
from workbench.discriminate.discrimination import (
    BUDGET,
    Designer,
    Discrimination,
    Played,
    Player,
    by_design,
    discriminate,
)
from workbench.discriminate.experiment_design import DesignedExperiment, Terms, courses
from workbench.discriminate.rival_odds import RivalOdds
from workbench.fit.fit_result import Fit
from workbench.fit.fitting import fit
from workbench.select.effect_candidates import pressure_speaks_against
from workbench.select.effect_search import evaluated
from workbench.select.equivalence import algebraic_class, classes
from workbench.select.separating_experiment import REST_S, experiment

PERIOD_S = 0.01
RATE_PA_PER_S = 400e3
LONGEST_S = 26.0
MENU_BUDGET = 120
WHOLE = 1000
"""More moves than an input of the menu has."""


def menu(race: RivalOdds, terms: Terms) -> DesignedExperiment | None:
    """Choose the whole input of the menu as a diagnosis does; there are no shorter ones.

    What told nothing comes again: a diagnosis knows of no round before.
    """
    chosen = experiment(race.alive, race.record, seed=terms.seed, workers=1)
    course = next(each for each in courses(race.record, Terms(terms.bounds, WHOLE)) if each.name == chosen.name)
    return DesignedExperiment(course, np.inf)


def player(made: Hidden, dirty: bool, seed: int, *, pressure: bool) -> Player:
    """Return the sealed valve, which answers experiments, with the pressure or without."""
    generator = np.random.default_rng(seed)
    truth = Composition.from_file(made.truth)
    quantum_m = made.truth.valve.stroke_m / LEVELS if dirty else 0.0

    def play(chosen: DesignedExperiment) -> Played:
        trial = Trial(chosen.course.sample_every(PERIOD_S)[1], PERIOD_S)
        answer = trial.with_disturbances(truth, generator) if dirty else trial.answer(truth, truth.theta)
        sensor = Sensor(noise_std_m=NOISE_M, quantum_m=quantum_m, seed=int(generator.integers(2**32)))
        whole = trial.recording(answer.indicated_m, sensor, answer.pressure_pa if pressure else None)
        settled = whole.time_s >= REST_S
        return Played(Recording({name: column[settled] for name, column in whole.columns.items()}))

    return play


HOW: dict[str, tuple[Designer, int]] = {"designed": (by_design, BUDGET), "menu": (menu, MENU_BUDGET)}


def not_contradicted(fits: Mapping[str, Fit], made: Hidden) -> dict[str, Fit]:
    """Return the fits that the measured pressure does not speak against."""
    parts = split([made.fit], made.test)
    models = {name: evaluated(each, parts) for name, each in fits.items()}
    return {
        name: each for name, each in fits.items() if not pressure_speaks_against(models[name], list(models.values()))
    }


def line(case: Line, how: Sequence[str], workers: int, *, pressure: bool) -> Line:
    """Play a case by either or both; return what is kept of it."""
    began_s = time.perf_counter()
    library = {name: shipped_effect(name, "library") for name in shipped_effects()}
    dirty = case["setting"] == "dirty"
    made = hide(case["seed"], dirty=dirty, pressure=pressure)
    recordings = [made.fit, made.test]
    whole = join_recordings(recordings)
    base = fit(whole, made.base, workers=workers)
    rivals = {name: fit(whole, made.base, effects=(name,), base=base, workers=workers) for name in case["sets"][0]}
    rivals = not_contradicted(rivals, made)
    commands_pa = ready(whole).command_pa
    stroke_m = made.base.valve.stroke_m
    bounds = ExperimentLimits(
        float(commands_pa.min()), float(commands_pa.max()), RATE_PA_PER_S, LONGEST_S, -0.1 * stroke_m, 1.1 * stroke_m
    )
    found = {
        name: discriminate(
            rivals,
            recordings,
            player(made, dirty, case["seed"], pressure=pressure),
            bounds,
            library,
            design=HOW[name][0],
            budget=HOW[name][1],
            workers=workers,
        )
        for name in how
    }
    return {
        "seed": case["seed"],
        "setting": case["setting"],
        "hidden": case["hidden"],
        "rivals": case["sets"][0],
        "seconds": round(time.perf_counter() - began_s, 1),
        **{name: _kept(each, case["hidden"][0]) for name, each in found.items()},
    }


def _kept(found: Discrimination, hidden: str) -> dict[str, Any]:
    library = {name: shipped_effect(name, "library") for name in shipped_effects()}
    right = bool(algebraic_class(hidden, library) & set(found.named)) if found.named else None
    return {
        "outcome": found.outcome,
        "named": list(found.named),
        "right": right,
        "moves": found.moves,
        "experiments": len(found.rounds),
    }


def cases(families: Sequence[str], seeds: Sequence[int] | None) -> list[Line]:
    """Return the kept blind cases that ended in one set of more than one class, the hidden effect visible."""
    library = {name: shipped_effect(name, "library") for name in shipped_effects()}
    lines = kept(KEPT)
    return [
        each
        for each in lines
        if each["verdict"] == "one_of"
        and each["visible"]
        and each["family"] in families
        and len(each["sets"]) == 1
        and len(classes(each["sets"][0], library)) > 1
        and (seeds is None or each["seed"] in seeds)
    ]


def report(lines: Sequence[Line]) -> Iterator[str]:
    """Yield a line a case, then the figures."""
    for each in lines:
        yield f"{each['seed']} {each['setting']:<6}{each['hidden'][0]} of {'/'.join(each['rivals'])}: " + "; ".join(
            f"{how} {each[how]['outcome']} {'/'.join(each[how]['named'])} {each[how]['moves']} moves"
            for how in HOW
            if how in each
        )
    for how in HOW:
        yield from _figures(how, [each[how] for each in lines if how in each])
    both = [each for each in lines if all(how in each and each[how]["right"] for how in HOW)]
    if both:
        shares = [each["designed"]["moves"] / each["menu"]["moves"] for each in both if each["menu"]["moves"]]
        yield f"moves, designed over menu, resolved by both: median {np.median(shares):.2f} of {len(shares)} cases"


def _figures(how: str, found: Sequence[Line]) -> Iterator[str]:
    count = len(found)
    if not count:
        return
    right, wrong = sum(each["right"] is True for each in found), sum(each["right"] is False for each in found)
    yield f"{how}: resolved rightly {right} of {count} ({right / count:.0%}), wrongly {wrong} ({wrong / count:.0%})"
    told = ", ".join(f"{name} {n}" for name, n in sorted(Counter(each["outcome"] for each in found).items()))
    yield f"  outcomes: {told}; moves in all {sum(each['moves'] for each in found)}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--family", nargs="*", choices=("clean", "dirty"), default=["clean", "dirty"])
    parser.add_argument("--cases", type=int, default=20, help="at most so many (20)")
    parser.add_argument("--seeds", type=int, nargs="*", help="these cases alone")
    parser.add_argument("--how", nargs="*", choices=HOW, default=list(HOW), help="experiments designed, or of the menu")
    parser.add_argument("--without-pressure", action="store_true", help="the actuator's pressure is not measured")
    parser.add_argument("--workers", type=int, default=1, help="threads (1)")
    parser.add_argument("--out", type=Path, help="where a line a case is kept; those there are not played again")
    arguments = parser.parse_args()
    lines = [] if arguments.out is None else kept(arguments.out)
    there = {each["seed"] for each in lines}
    for case in cases(arguments.family, arguments.seeds)[: arguments.cases]:
        if case["seed"] in there:
            continue
        done = line(case, arguments.how, arguments.workers, pressure=not arguments.without_pressure)
        lines.append(done)
        print(f"{done['seed']}: {done['seconds']:g} s", flush=True)
        keep(arguments.out, done)
    print(*report(lines), sep="\n")


if __name__ == "__main__":
    main()

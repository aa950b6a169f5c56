"""How many valves with an effect does the triage of `positioner fleet` leave undiagnosed, by how strong the effect is?

    python -m benchmarks.fleet_triage FILE.jsonl [--cases 300] [--workers 2] [--seed 5000]

A case is a valve of the simulated fleet (`benchmarks.simulated_fleet`) whose spring recording is bare, and whose
autumn recording has one effect of the library, each in turn, at 3 to 100 % of what `positioner hide` draws. How
strong it is in that recording is what the valve without it misses of the clean answer at its best, in floors, spring
and friction refitted to that very recording: the least that several searches come to, of which one begins at the true
values and shares no code with the workbench (`workbench.blind.trial`). From 0.5 on an effect is visible, and deserves
a diagnosis. The spring's model and what the triage makes of the autumn are `workbench.fleet.examination`'s.

Cases are kept a line each: the same command goes on where it ended, and prints the table of all that is there.
"""

import argparse
import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from benchmarks.kept_lines import Line, kept, run
from benchmarks.simulated_fleet import DURATION_S, PERIOD_S, recorded
from config.recording import Column
from config.valve_file import EffectTable, ValveFile
from sim.composition import Composition
from sim.effect import first_effects, shipped_effect
from workbench.blind.hiding import Hidden, hide, strength
from workbench.blind.trial import Trial, refitted_rmse_m
from workbench.compare.comparison import Comparison, compare
from workbench.compare.measures import rms
from workbench.fleet.examination import floor_to_reach_m, floors_allowed, is_structured, refit, refit_valve

EDGES = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 3.0, np.inf)
VISIBLE = 0.5
WEAKEST = 0.03
DEFAULT = floors_allowed(round(DURATION_S / PERIOD_S))
ALLOWED = (1.05, 1.1, DEFAULT, 1.2, 1.5)


def case(seed: int) -> Line:
    """Return what the triage makes of a valve with an effect, and how strong that is."""
    generator = np.random.default_rng([seed, 1])
    pool = first_effects()
    name = pool[seed % len(pool)]
    bare = hide(seed, effects=0, duration_s=DURATION_S, period_s=PERIOD_S)
    truth = ValveFile(valve=bare.truth.valve, effect=(_weakened(name, bare, generator),))
    autumn, clean_m = recorded(bare, truth, seed)
    spring = refit(bare.fit, bare.base)
    known = spring[0].valve if spring else bare.base
    floor_m = spring[1].floor_m if spring else None
    found, again = refit_valve(autumn, known)
    trial = Trial(bare.test.command_pa, PERIOD_S)
    least_m = [rms(_answer_m(trial, valve) - clean_m) for valve in (known, found.valve)]
    least_m += refitted_rmse_m([trial], [_answer_m(trial, truth)], bare.truth)
    return {
        "seed": seed,
        "effect": name,
        "strength": min(least_m) / rms(autumn.position_m - clean_m),
        "passes": _passes(floor_m, compare(autumn, known), again),
        "bare_passes": _passes(floor_m, compare(bare.test, known), refit_valve(bare.test, known)[1]),
    }


def _passes(known_floor_m: float | None, *comparisons: Comparison) -> float | None:
    """Return how many floors a look and refits must be allowed for one of them to pass; None: none can."""
    passing = [each for each in comparisons if each.adequate and not is_structured(each, known_floor_m)]
    floors_m = [(each.rms_m, floor_to_reach_m(each, known_floor_m)) for each in passing]
    return min((rms_m / floor_m for rms_m, floor_m in floors_m if floor_m), default=None)


def _weakened(name: str, bare: Hidden, generator: np.random.Generator) -> EffectTable:
    """Return an effect on the way from nothing to what is drawn for a valve."""
    effect = shipped_effect(name, "shipped effects")
    drawn = strength(effect, bare.truth.valve, bare.base.valve, generator).parameters
    share = WEAKEST ** generator.uniform()
    nothing = dict(zip(effect.parameters, effect.off(bare.truth.valve), strict=True))
    values = {key: nothing[key] + share * (value - nothing[key]) for key, value in drawn.items()}
    return EffectTable.model_validate({"name": name, **values})


def _answer_m(trial: Trial, valve: ValveFile) -> Column:
    composition = Composition.from_file(valve)
    return trial.answer_m(composition, composition.theta)


def table(cases: Sequence[Line]) -> list[str]:
    """Return lines: the share left undiagnosed by strength, for each error that a look or a refit may leave."""
    head = "".join(f"{f'{floors:.4g} floors':>14}" for floors in ALLOWED)
    lines = [f"{'strength, floors':18}{'cases':>7}{head}"]
    ranges = [*pairwise(EDGES), (VISIBLE, np.inf), (1.0, np.inf)]
    for low, high in ranges:
        chosen = [each["passes"] for each in cases if low <= each["strength"] < high]
        lines.append(f"{f'{low:g} to {high:g}':18}{len(chosen):7}" + "".join(_share(chosen, most) for most in ALLOWED))
    bare = [each["bare_passes"] for each in cases]
    lines.append(f"{'nothing hidden':18}{len(bare):7}" + "".join(_share(bare, most) for most in ALLOWED))
    return [*lines, *(_told(each) for each in cases if each["strength"] >= VISIBLE and _is_through(each["passes"]))]


def _share(passes: Sequence[float | None], most: float) -> str:
    through = sum(_is_through(each, most) for each in passes)
    return f"{f'{through} ({100 * through / len(passes):.1f} %)' if passes else '':>14}"


def _is_through(passes: float | None, most: float = DEFAULT) -> bool:
    return passes is not None and passes <= most


def _told(each: Line) -> str:
    return (
        f"  undiagnosed: {each['effect']} {each['strength']:.2f} floors, seed {each['seed']}, {each['passes']:.3f} left"
    )


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fleet_triage", description=__doc__.splitlines()[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--cases", type=int, default=300)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--seed", type=int, default=5000)
    given = parser.parse_args(words)
    cases = kept(given.file)
    there = {each["seed"] for each in cases}
    wanted = [(seed,) for seed in range(given.seed, given.seed + given.cases) if seed not in there]
    cases += run(given.file, case, wanted, given.workers)
    print(f"left undiagnosed, by what a look or a refit may leave; the fleet's is {DEFAULT:.4g} floors")
    print("\n".join(table(cases)))


if __name__ == "__main__":
    main()

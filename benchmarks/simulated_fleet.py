"""A plant of simulated valves, some with an effect that was not there before: how many does `positioner fleet` find?

    python -m benchmarks.simulated_fleet FOLDER [--valves 100] [--hidden 6] [--workers 2] [--seed 0] [--so-far]

Each valve (`workbench.blind.hiding`) is recorded twice, 20 s at 50 Hz: in spring it is bare, in autumn some have an
effect of the library, of a strength that is visible after a refit, and a tenth of the others have 30 % more friction.
What is known of each is a drawing: spring within 10 %, friction within a third. One recording in the fleet is no text,
one is not there. The truth lies beside, in `truth.json`, which the fleet is not shown.

It prints precision and recall of the valves with an effect, and of all that changed; how many of those with an effect
the triage left undiagnosed, how many were named right, and what it took. The plant is made once, and what was examined
is kept: broken off (`timeout` ends it in pieces), the same command goes on; once more, it says what a rerun takes.
With `--so-far` nothing more is examined: it judges the valves of which all recordings were.
"""

import argparse
import json
import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from config.recording import Column, Recording
from config.slave_file import Sensor
from config.valve_file import ValveFile
from config.valve_file_writer import write_valve
from sim.composition import Composition
from sim.effect import first_effects
from workbench.blind.hiding import Hidden, hide
from workbench.blind.trial import NOISE_M, Trial
from workbench.fleet.engine import cluster
from workbench.fleet.examination import AS_BEFORE, CHANGED
from workbench.fleet.fleet import Fleet, fleet
from workbench.fleet.tables import write_tables

DURATION_S, PERIOD_S = 20.0, 0.02
TIGHTER = 1.3
"""Factor on the friction of a valve whose packing was tightened."""
PACKING = "tighter packing"
ONE_IN = 10
TASKS = 500
SPRING, AUTUMN = "2026-03-01", "2026-09-01"


@dataclass(frozen=True, slots=True)
class Score:
    """What was found of what was hidden; names of valves."""

    found: set[str]
    false: set[str]
    missed: set[str]
    untried: set[str]
    """Of those missed: a refit explained what was recorded, so that nothing was diagnosed."""
    moved: set[str]
    """Of these: said to have changed."""
    named: set[str]
    """Of those found: the effect, or a set with it."""
    tightened: set[str]
    """Said to have changed, of those whose packing was tightened."""
    unchanged: set[str]
    """Said to have changed, or to have an effect, of those that are as they were."""


def make(folder: Path, valves: int, hidden: int, seed: int, workers: int) -> None:
    """Make the plant."""
    for name in ("valves", "recordings"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    draw = np.random.default_rng(seed)
    affected = set(draw.permutation(valves)[:hidden].tolist())
    others = [i for i in range(valves) if i not in affected]
    tightened = set(others[::ONE_IN])
    kinds = ["effect" if i in affected else PACKING if i in tightened else "" for i in range(valves)]
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        truth = dict(pool.map(partial(_valve, folder, 1000 * seed), range(valves), kinds))
    rows = ["valve,file,recording,when"]
    for name in truth:
        rows += [f"{name},valves/{name}.toml,recordings/{name}-{when}.csv,{when}" for when in (SPRING, AUTUMN)]
    poisoned, absent = (f"recordings/V{i:04d}-{AUTUMN}.csv" for i in others[1:3])
    (folder / poisoned).write_bytes(b"\x00\xff" * 999)
    (folder / absent).unlink()
    (folder / "plant.csv").write_text("\n".join([*rows, ""]))
    (folder / "truth.json").write_text(json.dumps(truth, indent=1))


def _valve(folder: Path, seed: int, number: int, kind: str) -> tuple[str, str]:
    """Write a valve and its recordings, unless they are there; return its name and what happened to it, or nothing."""
    name, own = f"V{number:04d}", seed + number
    made = folder / "valves" / f"{name}.json"
    if made.exists():
        return name, json.loads(made.read_text())
    record = partial(hide, own, duration_s=DURATION_S, period_s=PERIOD_S)
    bare = record(effects=0)
    truth, autumn = kind, bare.test
    if kind == "effect":
        truth, autumn = _with_effect(record, own)
    elif kind == PACKING:
        autumn = _tightened(bare, own)
    write_valve(folder / "valves" / f"{name}.toml", bare.base)
    bare.fit.write(folder / "recordings" / f"{name}-{SPRING}.csv")
    autumn.write(folder / "recordings" / f"{name}-{AUTUMN}.csv")
    made.write_text(json.dumps(truth))
    return name, truth


def _with_effect(record: Any, seed: int) -> tuple[str, Recording]:
    """Return the first effect, in an order drawn by the seed, that is visible in its recording, and that."""
    pool = first_effects()
    for i in np.random.default_rng(seed).permutation(len(pool)):
        hidden: Hidden = record(effects=[pool[i]])
        seen = hidden.answer["visible"][pool[i]]
        if seen["test_m"] > 0.5 * hidden.answer["floor_m"]["test"]:
            return pool[i], hidden.test
    raise RuntimeError(f"seed {seed}: no effect is visible on this valve")


def _tightened(bare: Hidden, seed: int) -> Recording:
    valve = bare.truth.valve
    tighter = valve.model_copy(update={"coulomb_n": TIGHTER * valve.coulomb_n, "static_n": TIGHTER * valve.static_n})
    return recorded(bare, ValveFile(valve=tighter), seed)[0]


def recorded(bare: Hidden, valve: ValveFile, seed: int) -> tuple[Recording, Column]:
    """Return what another valve makes of the same autumn, and the clean positions, m, (samples,)."""
    composition = Composition.from_file(valve)
    trial = Trial(bare.test.command_pa, PERIOD_S)
    clean_m = trial.answer_m(composition, composition.theta)
    return trial.recording(clean_m, Sensor(noise_std_m=NOISE_M, seed=seed)), clean_m


def score(found: Fleet, truth: Mapping[str, str]) -> Score:
    """Hold the ranking against the truth."""
    gravest = {course.name: course.gravest[1] for course in found.courses if course.gravest}
    changed = {name for name, each in gravest.items() if each.outcome == CHANGED}
    suspected = gravest.keys() - changed
    hidden = {name for name, happened in truth.items() if happened not in ("", PACKING)}
    last = {course.name: course.examined[-1][1] for course in found.courses}
    return Score(
        found=suspected & hidden,
        false=suspected - hidden,
        missed=hidden - suspected,
        untried={name for name in hidden - suspected if not last[name].candidates},
        moved=hidden & changed,
        named={name for name in suspected & hidden if truth[name] in (*gravest[name].effects, *gravest[name].rivals)},
        tightened={name for name in changed if truth[name] == PACKING},
        unchanged={name for name in gravest if not truth[name]},
    )


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simulated_fleet", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--valves", type=int, default=100)
    parser.add_argument("--hidden", type=int, default=6)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--so-far", action="store_true", help="examine nothing more")
    given = parser.parse_args(words)
    if not (given.folder / "plant.csv").exists():
        began_s = time.monotonic()
        make(given.folder, given.valves, given.hidden, given.seed, given.workers)
        print(f"made in {time.monotonic() - began_s:.0f} s")
    truth = json.loads((given.folder / "truth.json").read_text())
    began_s = time.monotonic()
    if given.so_far:
        found = _so_far(given.folder)
        truth = {course.name: truth[course.name] for course in found.courses}
    else:
        found = fleet(given.folder / "plant.csv", given.folder / "out", workers=given.workers)
    took_s = time.monotonic() - began_s
    write_tables(found.courses, given.folder / "out")
    result = score(found, truth)
    tightened = sum(happened == PACKING for happened in truth.values())
    hidden = sum(map(bool, truth.values())) - tightened
    diagnosed = sum(each.outcome not in (AS_BEFORE, CHANGED) for course in found.courses for _, each in course.readable)
    print(f"{len(truth)} valves, {hidden} with a hidden effect; {found.count} recordings, {len(found.bad)} unreadable")
    print(
        f"recall {len(result.found)} of {hidden}; precision {len(result.found)} of {len(result.found | result.false)}"
    )
    print(f"named right {len(result.named)} of {len(result.found)}; diagnosed {diagnosed} recordings")
    print(
        f"missed {len(result.missed)}: {len(result.untried)} explained by a refit, so not diagnosed, "
        f"{len(result.moved)} of these said to have changed"
    )
    as_it_was = len(truth) - hidden - tightened
    print(f"tightened and said to have changed: {len(result.tightened)} of {tightened}")
    print(f"as it was, yet complained of: {len(result.unchanged)} of {as_it_was} {sorted(result.unchanged) or ''}")
    said = {course.name: course.gravest[1].sentence if course.gravest else "nothing" for course in found.courses}
    for name in sorted(result.missed | result.false):
        print(f"  {'missed' if name in result.missed else 'false'}: {name} {truth[name]}: {said[name]}")
    print(f"{found.examined} examined in {took_s:.1f} s on {given.workers} workers")
    print(f"scheduler: {1e3 * overhead_s(given.workers):.1f} ms a task")


def _so_far(folder: Path) -> Fleet:
    """Return the fleet of the valves of which every recording was examined."""
    with mock.patch("workbench.fleet.fleet.cluster"), mock.patch("workbench.fleet.fleet.work"):
        whole = fleet(folder / "plant.csv", folder / "out")
    courses = tuple(course for course in whole.courses if len(course.examined) == len((SPRING, AUTUMN)))
    return replace(whole, courses=courses, count=sum(len(course.examined) for course in courses))


def overhead_s(workers: int) -> float:
    """Return what Dask takes for a task that does nothing, s."""
    with cluster(None, workers) as client:
        client.gather([client.submit(abs, 0, pure=False) for _ in range(workers)])
        began_s = time.monotonic()
        client.gather([client.submit(abs, i, pure=False) for i in range(TASKS)])
        return (time.monotonic() - began_s) / TASKS


if __name__ == "__main__":
    main()

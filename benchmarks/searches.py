"""Whether a search finds the least error, whatever the last bits of its input.

Each case hides one effect (`workbench.blind.hiding`) and gives its name to the fit. The same record is searched several
times, with position, command and the start disturbed by 1e-12 of themselves, so that the last bits of every sum differ.
A search has found the least if its cost is within 1 % of the best search's of its case.

    full    30 s at 100 Hz, all the moves of the generator
    poor    the same records, cut off after their twelfth slip

A line of JSON is kept a search, so that a campaign can be broken off and taken up again:

    python -m benchmarks.searches --cases 1 --searches 10        23 effects, 230 searches: some minutes of two cores
    python -m benchmarks.searches --effects backlash --kind poor
    python -m benchmarks.searches --table                        runs nothing, prints what is there

    python -m benchmarks.searches --cases 22 --searches 1 --kind full poor --first-seed SEED     1012 cases: an hour

The figures are the share of searches that found the least; how many did not, and of those how many were trusted; and
how many come to more than 1 % above the cost of the true parameters, of which at most one in a thousand is allowed
where the effect shows: where the valve without it misses by half the floor more, at 1.25 times that cost.
"""

import argparse
import os
import time
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import count, islice
from pathlib import Path
from typing import Literal, NamedTuple, get_args

import numpy as np

from benchmarks.kept_lines import Line, kept, run
from config.errors import InputError
from config.recording import Column, Recording
from config.valve_file import ValveFile, ValveParameters
from signals.moves import slips
from sim.effect import first_effects
from workbench.blind.hiding import draw_effects, hide
from workbench.data.record import ready
from workbench.data.stretches import informative
from workbench.fit.fit_problem import problem
from workbench.fit.fitting import base_fit, fit

Kind = Literal["full", "poor"]
FIRST_SEED = 52000
"""No case from here on had been looked at when the search was written."""
FEW_SLIPS = 12
AFTER_LAST_S = 0.5
"""What is kept after the last slip of a poor record."""
DISTURBED = 1e-12
WITHIN, SHOWS = 1.01, 1.25
TARGET = 0.999
STARTS = ("spring_n_per_m", "viscous_ns_per_m", "coulomb_n", "static_n")
HEAD = f"  {'':<22}{'cases':>6}{'searches':>9}{'found':>8}{'wrong':>6}{'trusted wrong':>14}{'above truth':>12}{'s':>6}"
FILE = Path("build/searches.jsonl")


class Case(NamedTuple):
    """A hidden effect, the seed of its generator, and what is left of the record."""

    effect: str
    seed: int
    kind: Kind


class Task(NamedTuple):
    """One search of a case; `number` is the seed of its disturbance."""

    case: Case
    number: int


def cases(effects: Sequence[str], cases_each: int, kinds: Sequence[Kind], first_seed: int) -> list[Case]:
    """Return the first seeds from one on with which the generator draws each effect."""
    return [
        Case(effect, seed, kind)
        for effect in effects
        for seed in islice((seed for seed in count(first_seed) if drawn(seed) == effect), cases_each)
        for kind in kinds
    ]


@cache
def drawn(seed: int) -> str:
    """Return the name of the effect that `hide` draws with a seed."""
    _, for_effects, *_ = map(np.random.default_rng, np.random.SeedSequence(seed).spawn(5))
    return draw_effects(for_effects, 1)[0].name


@cache
def posed(case: Case) -> tuple[Recording, ValveFile, ValveFile]:
    """Return the record, the valve as it is known, and as it is."""
    hidden = hide(case.seed)
    assert [each.name for each in hidden.truth.effect] == [case.effect]
    return (hidden.fit if case.kind == "full" else cut(hidden.fit)), hidden.base, hidden.truth


def cut(recording: Recording) -> Recording:
    """Cut a recording off after its twelfth slip."""
    record = ready(recording)
    last = slips(record.position_m, record.scale_m)[:FEW_SLIPS][-1].last
    end = last + round(AFTER_LAST_S / record.period_s)
    return Recording({name: each[:end] for name, each in recording.columns.items()}, recording.metadata)


def disturbed(recording: Recording, valve: ValveFile, number: int) -> tuple[Recording, ValveFile]:
    """Change position, command and the start by 1e-12 of themselves."""
    generator = np.random.default_rng(number)

    def stirred(values: Column) -> Column:
        return values * (1.0 + DISTURBED * generator.standard_normal(values.shape))

    columns = dict(recording.columns)
    columns |= {name: stirred(columns[name]) for name in ("command_pa", "position_m")}
    starts = {name: float(stirred(np.array(getattr(valve.valve, name)))) for name in STARTS}
    changed = ValveParameters.model_validate(valve.valve.model_dump() | starts)
    return Recording(columns, recording.metadata), ValveFile(valve=changed, effect=valve.effect)


def searched(task: Task) -> Line:
    """Search once; return what is kept of it: of a record that no valve is fitted to, why."""
    recording, valve, truth = posed(task.case)
    stirred, start = disturbed(recording, valve, task.number)
    began_s = time.process_time()
    try:
        base = fit(stirred, start, workers=1)
    except InputError as error:
        return {**task.case._asdict(), "number": task.number, "refused": error.problem}
    base_s = time.process_time() - began_s
    found = fit(stirred, start, effects=(task.case.effect,), workers=1, base=base)
    return {
        **task.case._asdict(),
        "number": task.number,
        "cost": found.cost,
        "rms_m": found.rms_m,
        "true_cost": true_cost(stirred, truth),
        "base_cost": base.cost,
        "count": found.count,
        "trusted": found.trusted,
        "base_trusted": base.trusted,
        "agreement": found.agreement,
        "parameters": {name: each.value for name, each in found.parameters.items()},
        "base_seconds": round(base_s, 2),
        "seconds": round(time.process_time() - began_s, 2),
    }


def true_cost(recording: Recording, truth: ValveFile) -> float:
    """Return the cost of the true parameters, over what of the recording is fitted."""
    return base_fit(problem(ready(informative(recording)), truth.valve), truth, free=()).cost


def report(lines: Sequence[Line]) -> Iterator[str]:
    """Yield the figures by kind and effect."""
    refused = [each for each in lines if "refused" in each]
    lines = [each for each in lines if "refused" not in each]
    yield from (f"{each['effect']} {each['seed']} {each['kind']} is refused: {each['refused']}" for each in refused)
    for kind in get_args(Kind):
        chosen = [each for each in lines if each["kind"] == kind]
        if not chosen:
            continue
        yield f"{kind}: {len(chosen)} searches of {len(_by_case(chosen))} cases"
        yield HEAD
        for effect in first_effects():
            own = [each for each in chosen if each["effect"] == effect]
            if own:
                yield _row(effect, own)
        yield _row("all", chosen)
    if lines:
        yield f"{_within(lines)} within 1 % of the cost of the true parameters"
        shown = [each for each in lines if each["base_cost"] >= SHOWS * each["true_cost"]]
        yield f"{_within(shown)} where the effect shows; target {TARGET:.1%}"


def _within(lines: Sequence[Line]) -> str:
    within = sum(each["cost"] <= WITHIN * each["true_cost"] for each in lines)
    return f"{within} of {len(lines)} searches"


def _row(name: str, lines: Sequence[Line]) -> str:
    by_case = _by_case(lines)
    best = {case: min(each["cost"] for each in own) for case, own in by_case.items()}
    wrong = [each for each in lines if each["cost"] > WITHIN * best[_case(each)]]
    trusted = sum(each["trusted"] for each in wrong)
    above = sum(each["cost"] > WITHIN * each["true_cost"] for each in lines)
    found = 1.0 - len(wrong) / len(lines)
    counts = f"{len(by_case):>6}{len(lines):>9}{found:>8.1%}{len(wrong):>6}{trusted:>14}{above:>12}"
    return f"  {name:<22}{counts}{float(np.mean([each['seconds'] for each in lines])):>6.1f}"


def _case(line: Line) -> tuple[str, int, str]:
    return line["effect"], line["seed"], line["kind"]


def _by_case(lines: Sequence[Line]) -> dict[tuple[str, int, str], list[Line]]:
    found: dict[tuple[str, int, str], list[Line]] = {}
    for each in lines:
        found.setdefault(_case(each), []).append(each)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--effects", nargs="*", choices=first_effects(), default=first_effects(), metavar="NAME")
    parser.add_argument("--kind", nargs="*", choices=get_args(Kind), default=["full"])
    parser.add_argument("--cases", type=int, default=1, help="of each effect (1)")
    parser.add_argument("--searches", type=int, default=10, help="of each case (10)")
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED, help=f"of the generator ({FIRST_SEED})")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes (one a core)")
    parser.add_argument("--out", type=Path, default=FILE, help=f"where a line a search is kept ({FILE})")
    parser.add_argument("--table", action="store_true", help="run nothing, print the table")
    arguments = parser.parse_args()
    lines = kept(arguments.out)
    there = {(*_case(each), each["number"]) for each in lines}
    posed_cases = (
        [] if arguments.table else cases(arguments.effects, arguments.cases, arguments.kind, arguments.first_seed)
    )
    tasks = [Task(case, number) for case in posed_cases for number in range(arguments.searches)]
    todo = [each for each in tasks if (*each.case, each.number) not in there]
    lines += run(arguments.out, searched, [(each,) for each in todo], arguments.workers)
    print(*report(lines), sep="\n")


if __name__ == "__main__":
    main()

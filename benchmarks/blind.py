"""Blind cases through the whole diagnosis: `make blind` runs what is missing of the campaign and prints its tables.

    clean      one effect drawn at random of the whole library, noise of 0.05 mm      `workbench.blind.hiding`
    dirty      the same with pressure noise, break-away jitter and 12 bits
    nothing    no effect, clean and dirty in turn
    two        two effects, clean
    two_dirty  two effects, dirty
    removed    one effect, clean, taken out of the library: the right verdict is "unexplained", or an equivalent: what
               does as well as the effect itself on both recordings, by the rule for sets; or its richer form, which
               comes after it (`AFTER`)
    others     what `tests/workbench/generators.py` makes: other integrators and friction laws, what the library has
    outside    the same, what the library lacks
    few_slips  one effect, or none, and a minute of three to eight moves, by `benchmarks.few_slips`

Every case is diagnosed against all effects, with one worker; the answer is opened afterwards. A line of JSON is kept a
case, so that a campaign can be broken off and taken up again. An effect counts if it is visible: the valve without it,
refitted by the generator and by the diagnosis, misses at least half the floor both times. What an exact equivalence of
the library's own declarations makes the same effect counts as that effect: no record could tell it.
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.few_slips import drawn, effects_of
from benchmarks.kept_lines import Line, kept, run
from config.recording import Recording
from config.valve_file import ValveFile, find_valve, load_valve
from sim.composition import Composition
from sim.effect import shipped_effect, tried_effects
from tests.workbench.generators import KINDS, LAWS, case
from workbench.blind.hiding import VISIBLE_FLOORS, hide
from workbench.blind.trial import NOISE_M
from workbench.diagnosis.diagnosis import Diagnosis, diagnose
from workbench.select.effect_candidates import indistinguishable
from workbench.select.equivalence import algebraic_class

SEEDS: Mapping[str, range] = {
    "clean": range(81000, 81100),
    "dirty": range(82000, 82060),
    "nothing": range(83000, 83300),
    "two": range(84000, 84020),
    "two_dirty": range(86000, 86010),
    "removed": range(85000, 85040),
    "others": range(2900, 2915),
    "outside": range(2950, 2965),
    "few_slips": range(1000, 1060),
}
"""Nobody has looked at a case before the rules stood."""
APART = 100
"""Seeds farther from each other are told as another span."""
NAMES_ALL = ("adequate", "missing", "one_of")
"""Verdicts by which what is named is all there is."""
KEPT = Path("tests/change_indication/cases.jsonl")
"""Where the lines are kept: what the workbench says today, by which a change of it is seen."""
MOVED = 0.1
"""Of an error, or of a parameter's interval, beyond which it has moved."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What is diagnosed, and what only the judge knows."""

    fit: Recording
    test: Recording
    base: ValveFile
    library: Sequence[str]
    hidden: tuple[str, ...]
    visible: bool
    fit_floor_m: float
    floor_m: float
    """Of the record held out."""
    setting: str
    truth: Mapping[str, float] = field(default_factory=dict)
    """By the names of fitted parameters; empty where another law made the record."""


def problem(family: str, seed: int) -> Problem:
    """Make the case of a family with a seed."""
    if family in {"others", "outside"}:
        return _other(family, seed)
    if family == "few_slips":
        return _few_slips(seed)
    count = {"nothing": 0, "two": 2, "two_dirty": 2}.get(family, 1)
    dirty = family in {"dirty", "two_dirty"} or (family == "nothing" and seed % 2 == 1)
    made = hide(seed, effects=count, dirty=dirty)
    hidden = tuple(each.name for each in made.truth.effect)
    library = [name for name in tried_effects() if family != "removed" or name not in _same(hidden[0])]
    visible = all(each["is_visible"] for each in made.answer["visible"].values())
    floor_m = made.answer["floor_m"]
    setting = "dirty" if dirty else "clean"
    own = Composition.from_file(made.truth)
    truth = dict(zip(own.names, map(float, own.theta), strict=True))
    return Problem(
        made.fit, made.test, made.base, library, hidden, visible, floor_m["fit"], floor_m["test"], setting, truth
    )


def _other(family: str, seed: int) -> Problem:
    number = seed - SEEDS[family].start
    kinds = sorted(name for name, kind in KINDS.items() if (kind.in_library is not None) == (family == "others"))
    kinds = [name for name in kinds if name not in {"nothing", "presliding"}]
    law = sorted(LAWS)[number % len(LAWS)]
    kind = kinds[number % len(kinds)]
    made = case(kind, law=law, seed=seed)
    return Problem(made.fit, made.test, made.base, tried_effects(), (kind,), True, NOISE_M, NOISE_M, law)


def _few_slips(seed: int) -> Problem:
    effects = effects_of(seed)
    made, base = drawn(seed, effects), load_valve(find_valve("seed"))
    truth = {**made.valve, **made.hidden}
    return Problem(
        made.fit, made.test, base, tried_effects(), effects, True, made.noise_m, made.noise_m, "clean", truth
    )


def _same(name: str) -> frozenset[str]:
    library = {each: shipped_effect(each, "library") for each in tried_effects()}
    return algebraic_class(name, library)


def line(family: str, seed: int) -> Line:
    """Diagnose a case; return what is kept of it."""
    posed = problem(family, seed)
    began_s, cpu_s = time.perf_counter(), time.process_time()
    found = diagnose(posed.fit, posed.base, test=posed.test, effects=posed.library, workers=1)
    return {
        "family": family,
        "seed": seed,
        "setting": posed.setting,
        "hidden": list(posed.hidden),
        "visible": posed.visible and _missed_m(found, posed.fit_floor_m) > VISIBLE_FLOORS * posed.fit_floor_m,
        "verdict": found.verdict,
        "missing": list(found.missing),
        **({"equivalent": _is_equivalent(found, posed)} if family == "removed" else {}),
        "suspected": list(found.suspected),
        "sets": [[each.name for each in step.indistinguishable] for step in found.steps if step.added],
        "ranked": [each.name for each in found.steps[0].candidates[:3]],
        "at_floor": found.best.at_floor,
        "structured": found.best.structured,
        "base_rmse_m": found.base.errors.test_rmse_m,
        "best_rmse_m": found.best.errors.test_rmse_m,
        "best_block_m": found.best.errors.test_block_m,
        "best_train_rmse_m": found.best.errors.train_rmse_m,
        "best_train_block_m": found.best.errors.train_block_m,
        "structure": found.best.errors.structure,
        "floor_m": posed.floor_m,
        "told_floor_m": found.split.floor_m,
        "parameters": _parameters(found),
        "truth": {name: posed.truth[name] for name in found.best.fit.parameters if name in posed.truth},
        "seconds": round(time.perf_counter() - began_s, 1),
        "cpu_seconds": round(time.process_time() - cpu_s, 1),
    }


def is_richer(line: Line) -> bool:
    """Whether all that is named is a richer form of what was hidden: it comes after that, as its file says."""
    named = line["missing"] if line["verdict"] in NAMES_ALL else []
    return bool(named) and all(shipped_effect(name, "library").after in line["hidden"] for name in named)


def _is_equivalent(found: Diagnosis, posed: Problem) -> bool:
    """Whether what is named as all there is does as well as the removed effect itself, by the rule for sets."""
    if found.verdict not in NAMES_ALL:
        return False
    itself = diagnose(posed.fit, posed.base, test=posed.test, effects=posed.hidden, workers=1)
    return indistinguishable(itself.best, found.best)


def _missed_m(found: Diagnosis, floor_m: float) -> float:
    """Return what the valve without the effect misses of the fitted record, beyond the floor, m."""
    return float(np.sqrt(max(0.0, found.base.errors.train_rmse_m**2 - floor_m**2)))


def _parameters(found: Diagnosis) -> dict[str, list[float]]:
    """Return value and ends of the 95 % interval."""
    return {name: [each.value, each.lower, each.upper] for name, each in found.best.fit.parameters.items()}


def changes(before: Line, after: Line) -> list[str]:
    """Return what a case says otherwise than before."""
    said = [f"{key} {before[key]} to {after[key]}" for key in ("verdict", "sets") if before[key] != after[key]]
    for key in ("best_train_rmse_m", "best_rmse_m"):
        if abs(after[key] - before[key]) > MOVED * before["floor_m"]:
            said.append(f"{key} {before[key]:.4g} to {after[key]:.4g}")
    for name, (value, lower, upper) in before["parameters"].items():
        now = after["parameters"].get(name, [float("nan")])[0]
        if abs(now - value) > MOVED * (upper - lower):
            said.append(f"{name} {value:.4g} to {now:.4g}, 95 % {lower:.4g} to {upper:.4g}")
    return said


def named(each: Line, hidden: str) -> bool:
    """Whether the hidden effect, or one that is the same by algebra, is in a set that the diagnosis names."""
    return any(_same(hidden) & set(names) for names in each["sets"])


def first(each: Line) -> bool:
    """Whether a hidden effect is the first added, or in its set; where none was added, suspected, or best by evidence.

    That of a line kept before there were suspicions is the best by evidence.
    """
    said = set((each["sets"] or [each.get("suspected") or each["ranked"][:1]])[0])
    return any(_same(hidden) & said for hidden in each["hidden"])


def single(each: Line) -> bool:
    """Whether one effect alone, up to algebra, is named as all that is missing."""
    if each["verdict"] == "missing":
        return len(each["missing"]) == 1
    return each["verdict"] == "one_of" and len(each["sets"]) == 1 and set(each["sets"][0]) <= _same(each["missing"][0])


def summary(lines: Sequence[Line]) -> Iterator[str]:
    """Yield the table of docs/blind.md: a row a family; what is counted is visible, but where nothing is hidden."""
    heads = ("cases", "visible", "true effect named", "named alone, and right", "unexplained", "none named")
    yield f"| family | {' | '.join(heads)} | error, floors | time, s |"
    yield "|---" * (len(heads) + 3) + "|"
    for family in SEEDS:
        chosen = [each for each in lines if each["family"] == family]
        seen = [each for each in chosen if each["visible"] or family == "nothing"]
        if not seen:
            continue
        ones = [first(each) for each in seen if single(each)]
        row = [
            len(chosen),
            sum(each["visible"] for each in chosen if each["hidden"]),
            sum(any(named(each, name) for name in each["hidden"]) for each in seen),
            f"{sum(ones)} of {len(ones)}",
            sum(each["verdict"] in {"unexplained", "untrusted"} for each in seen),
            sum(not each["missing"] for each in seen),
            f"{np.median([each['best_rmse_m'] / each['floor_m'] for each in seen]):.2f}",
            f"{np.median([each['cpu_seconds'] for each in chosen]):.0f}",
        ]
        yield f"| {family} | {' | '.join(map(str, row))} |"


def report(lines: Sequence[Line]) -> Iterator[str]:
    """Yield the figures, family by family, the intervals that hold, and the confusion table."""
    yield from summary(lines)
    yield ""
    yield from intervals(lines)
    yield ""
    for family in SEEDS:
        chosen = [each for each in lines if each["family"] == family]
        if chosen:
            yield from _figures(family, chosen)
            yield ""
    yield from confusion([each for each in lines if each["family"] in {"clean", "dirty"} and each["visible"]])


def intervals(lines: Sequence[Line]) -> Iterator[str]:
    """Yield how many 95 % intervals contain the truth, where all that is hidden was named, and nothing else."""
    right = [
        each
        for each in lines
        if each["hidden"] and each["verdict"] in NAMES_ALL and sorted(each["missing"]) == sorted(each["hidden"])
    ]
    yield "95 % intervals that contain the truth, of cases whose effects were named and nothing else"
    for family in SEEDS:
        held: dict[str, list[bool]] = {"valve": [], "effects": []}
        for each in right:
            if each["family"] != family:
                continue
            for name, value in each.get("truth", {}).items():
                _, lower, upper = each["parameters"][name]
                held["effects" if "." in name else "valve"].append(lower <= value <= upper)
        for whose, contained in held.items():
            if contained:
                yield share(f"{family}: {whose}", contained)


def _figures(family: str, lines: Sequence[Line]) -> Iterator[str]:
    seeds = [each["seed"] for each in lines]
    seen = [each for each in lines if each["visible"]]
    yield f"{family}: {len(lines)} cases, seeds {_spans(sorted(seeds))}"
    yield f"  {'seconds of one core a case, median':<52}{np.median([each['cpu_seconds'] for each in lines]):.0f}"
    if family == "nothing":
        for setting in ("clean", "dirty"):
            alarms = [bool(each["missing"]) for each in lines if each["setting"] == setting]
            yield share(f"false alarms, {setting}", alarms)
            honest = [each["verdict"] == "adequate" for each in lines if each["setting"] == setting]
            yield share(f"called adequate, {setting}", honest)
            hinted = [bool(each["suspected"]) for each in lines if each["setting"] == setting and "suspected" in each]
            yield share(f"something suspected, not proved, {setting}", hinted)
        return
    yield f"  {'visible':<52}{len(seen)} of {len(lines)}"
    if family in {"removed", "outside"}:
        unexplained = [each["verdict"] in {"unexplained", "untrusted"} for each in seen]
        same = [each.get("equivalent", False) for each in seen]
        richer = [is_richer(each) and not alike for each, alike in zip(seen, same, strict=True)]
        yield share("called unexplained", unexplained)
        if any(same):
            yield share("an equivalent, as good on both recordings", same)
        if any(richer):
            yield share("its richer form, which comes after it", richer)
        right = zip(unexplained, same, richer, strict=True)
        yield share("a wrong effect, or none, named as all there is", [not any(each) for each in right])
        return
    bare = _bare()
    known = [each for each in seen if not set(each["hidden"]) <= bare]
    same = [each for each in seen if set(each["hidden"]) <= bare]
    if same:
        yield share("the bare valve by another name: nothing named", [not each["missing"] for each in same])
    yield share("true effect first, or in the set with it", [first(each) for each in known])
    yield share("true effect named", [any(named(each, name) for name in each["hidden"]) for each in known])
    if family in {"two", "two_dirty"}:
        yield share("both named", [all(named(each, name) for name in each["hidden"]) for each in known])
    ones = [each for each in known if single(each)]
    yield share("one alone named: right", [first(each) for each in ones])
    falls = [each["best_rmse_m"] / each["floor_m"] for each in known]
    if falls:
        middle, ninety = np.quantile(falls, [0.5, 0.9])
        yield f"  {'held-out error over the floor: median, 90 %':<52}{middle:.2f}, {ninety:.2f}"
    for verdict, count in sorted(Counter(each["verdict"] for each in known).items()):
        yield f"  {'verdict ' + verdict:<52}{count}"


def _spans(seeds: Sequence[int]) -> str:
    begins = [seed for i, seed in enumerate(seeds) if not i or seed - seeds[i - 1] > APART]
    ends = [seed for i, seed in enumerate(seeds) if i + 1 == len(seeds) or seeds[i + 1] - seed > APART]
    return " and ".join(f"{begin} to {end}" for begin, end in zip(begins, ends, strict=True))


def _bare() -> frozenset[str]:
    """Return the effects that the bare valve already does: nothing is missing, and nothing can be."""
    return frozenset(name for name in tried_effects() if any(each not in tried_effects() for each in _same(name)))


def confusion(lines: Sequence[Line]) -> Iterator[str]:
    """Yield for each effect what was named in its place; sets by their first names."""
    yield "hidden effect: what was named, clean and dirty, visible cases"
    for name in tried_effects():
        said = Counter(
            "+".join("/".join(names) for names in each["sets"]) or each["verdict"]
            for each in lines
            if each["hidden"] == [name]
        )
        if said:
            yield f"  {name:<22}" + ", ".join(f"{what} {count}" for what, count in said.most_common())


def share(what: str, holds: Sequence[bool]) -> str:
    """Say how many hold."""
    return f"  {what:<52}{sum(holds)} of {len(holds)}" + (f" ({sum(holds) / len(holds):.1%})" if holds else "")


def missing(families: Sequence[str], lines: Sequence[Line]) -> list[tuple[str, int]]:
    """Return the planned cases that are not there, in turn through the families, so that all grow together."""
    there = {each["seed"] for each in lines}
    planned = [
        ((i + 0.5) / len(SEEDS[family]), family, seed) for family in families for i, seed in enumerate(SEEDS[family])
    ]
    return [(family, seed) for _, family, seed in sorted(planned) if seed not in there]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--family", nargs="*", choices=SEEDS, default=list(SEEDS), help="families to run (all)")
    parser.add_argument("--cases", type=int, help="run at most so many now (all)")
    parser.add_argument("--out", type=Path, default=KEPT, help="the file in which a line a case is kept")
    parser.add_argument("--workers", type=int, help="processes (one a core)")
    parser.add_argument("--table", action="store_true", help="run nothing, print the tables")
    parser.add_argument("--moved", type=Path, metavar="FILE", help="run the kept cases anew into FILE; say what moved")
    arguments = parser.parse_args()
    if arguments.moved:
        _print_moved(kept(arguments.out), arguments.moved, arguments)
        return
    file = arguments.out
    lines = kept(file)
    todo = [] if arguments.table else missing(arguments.family, lines)[: arguments.cases]
    for each in run(file, line, todo, arguments.workers):
        lines.append(each)
        print(_told(each), flush=True)
    print(*report(lines), sep="\n")


def _print_moved(before: Sequence[Line], file: Path, arguments: argparse.Namespace) -> None:
    """Run kept cases anew, and print what of each moved, and how the seconds did."""
    by_seed = {(each["family"], each["seed"]): each for each in before if each["family"] in arguments.family}
    there = {(each["family"], each["seed"]): each for each in kept(file)}
    todo = [each for each in by_seed if each not in there][: arguments.cases]
    for each in (*there.values(), *run(file, line, todo, arguments.workers)):
        then = by_seed.get((each["family"], each["seed"]))
        if then is None:
            continue
        said = changes(then, each)
        print(
            f"{each['family']} {each['seed']} {then['cpu_seconds']} to {each['cpu_seconds']} s",
            *said,
            sep="; ",
            flush=True,
        )


def _told(each: Line) -> str:
    hidden = (", ".join(each["hidden"]) or "nothing") + ("" if each["visible"] else " (invisible)")
    sets = " + ".join("/".join(names) for names in each["sets"])
    return (
        f"{each['family']} {each['seed']} {hidden}: {each['verdict']} {sets}; "
        f"{1e3 * each['base_rmse_m']:.4f} to {1e3 * each['best_rmse_m']:.4f} mm, floor {1e3 * each['floor_m']:.4f}; "
        f"{each['cpu_seconds']:.0f} s of a core"
    )


if __name__ == "__main__":
    main()

"""What a measured actuator pressure is worth: dirty valves of the blind campaign, by the command and by the pressure.

    python -m benchmarks.measured_pressure [--cases 24] [--seeds 72007 ...] [--nothing] [--out FILE]

The kept campaign has diagnosed them by the command (`benchmarks.blind`, families dirty and nothing). The same seeds
make the same valves here, whose actuator's pressure is measured besides, to whole millibars, and the stem is diagnosed
by it: what acts before it is left out. A line of JSON is kept a case, so that a run can be taken up again.

    alone      the hidden effect, or what is one with it by algebra, is all that is named
    in a set   it is named among others
    wrong      another is named, alone or in a set without it
    nothing    nothing is named
"""

import argparse
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path

from benchmarks.blind import KEPT
from benchmarks.kept_lines import Line, keep, kept
from sim.effect import shipped_effect, tried_effects
from workbench.blind.hiding import hide
from workbench.diagnosis.diagnosis import diagnose
from workbench.select.equivalence import algebraic_class

HOW = ("by the command", "by the pressure")


def cases(family: str, seeds: Sequence[int] | None) -> list[Line]:
    """Return kept cases of dirty valves: with an effect of the stem that shows, or with nothing hidden."""
    library = {name: shipped_effect(name, "library") for name in tried_effects()}
    return [
        each
        for each in kept(KEPT)
        if each["family"] == family
        and each["setting"] == "dirty"
        and (each["visible"] or not each["hidden"])
        and not any("pressure" in library[name].functions for name in each["hidden"])
        and (seeds is None or each["seed"] in seeds)
    ]


def line(case: Line) -> Line:
    """Diagnose a case by its pressure; return what is kept of it, and of the campaign's line."""
    began_s = time.process_time()
    made = hide(case["seed"], effects=len(case["hidden"]), dirty=True, pressure=True)
    found = diagnose(made.fit, made.base, test=made.test, workers=1, from_pressure=True)
    return {
        "seed": case["seed"],
        "hidden": case["hidden"],
        "before": {each: case[each] for each in ("verdict", "missing", "sets", "best_rmse_m", "cpu_seconds")},
        "verdict": found.verdict,
        "missing": list(found.missing),
        "sets": [[each.name for each in step.indistinguishable] for step in found.steps if step.added],
        "best_rmse_m": found.best.errors.test_rmse_m,
        "told_floor_m": found.split.floor_m,
        "cpu_seconds": round(time.process_time() - began_s, 1),
    }


def outcome(hidden: Sequence[str], told: Line) -> str:
    """Return what became of a case."""
    if not told["missing"] or told["verdict"] == "untrusted":
        return "nothing"
    library = {name: shipped_effect(name, "library") for name in tried_effects()}
    right = set(algebraic_class(hidden[0], library)) if hidden else set()
    if len(told["missing"]) == 1 and set(told["sets"][0]) <= right:
        return "alone"
    named = {name for each in told["sets"] for name in each} | set(told["missing"])
    return "in a set" if named & right else "wrong"


def report(lines: Sequence[Line]) -> Iterator[str]:
    """Yield a line a case, then the figures."""
    outcomes = [(outcome(each["hidden"], each["before"]), outcome(each["hidden"], each)) for each in lines]
    for each, (before, after) in zip(lines, outcomes, strict=True):
        error = f"{1e3 * each['before']['best_rmse_m']:.3f} to {1e3 * each['best_rmse_m']:.3f} mm"
        named = ", ".join("/".join(one) for one in each["sets"]) or "-"
        yield f"{each['seed']} {'+'.join(each['hidden']) or 'nothing'}: {before} -> {after} ({named}; held out {error})"
    for how, of_case in zip(HOW, zip(*outcomes, strict=True), strict=True):
        yield f"{how}: " + ", ".join(f"{name} {n}" for name, n in sorted(Counter(of_case).items()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", type=int, default=24, help="at most so many (24)")
    parser.add_argument("--seeds", type=int, nargs="*", help="these cases alone")
    parser.add_argument("--nothing", action="store_true", help="valves in which nothing is hidden")
    parser.add_argument("--out", type=Path, help="where a line a case is kept; those there are not diagnosed again")
    arguments = parser.parse_args()
    lines = [] if arguments.out is None else kept(arguments.out)
    there = {each["seed"] for each in lines}
    todo = cases("nothing" if arguments.nothing else "dirty", arguments.seeds)[: arguments.cases]
    for case in (each for each in todo if each["seed"] not in there):
        lines.append(line(case))
        keep(arguments.out, lines[-1])
    print(*report(lines), sep="\n")


if __name__ == "__main__":
    main()

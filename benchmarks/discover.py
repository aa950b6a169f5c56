"""Does `discover` find forms that the library lacks? Blind cases, the answer opened afterwards; the table is printed.

    library    each static and each velocity effect of the library in turn: the discovery knows none of them by name
    outside    five forces that the library does not have, `benchmarks/outside/`
    nothing    no effect, clean and dirty in turn: whatever form is believed is a false alarm

Every case has two recordings of 20 s at 100 Hz, one to fit and one held out, of a valve drawn at random
(`workbench.blind.hiding`). It counts where the effect is visible. Found is a form that is believed and whose held-out
error is within 1.5 floors; the floor is what the true valve itself misses. A line of JSON a case is kept, so that it
can be broken off and taken up.
"""

import argparse
import os
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.kept_lines import Line, kept, run
from workbench.blind.hiding import hide
from workbench.discover.discovery import discover

STATIC = (
    "preload", "sensor_offset", "spring_hardening", "flow_force", "area_variation", "sensor_nonlinearity",
    "asymmetric_friction", "position_friction", "pressure_friction", "pressure_power_friction", "supply_limit",
    "end_stop",
)  # fmt: skip
VELOCITY = ("quadratic_drag", "asymmetric_viscosity", "stribeck")
OUTSIDE = ("root_drag", "tight_spot", "detent", "second_spring", "reversal_memory")
SEEDS = {"library": 45100, "outside": 45500, "nothing": 44000}
"""The first of each family; nobody has looked at a case before the rules stood."""
NOTHING = 200
WITHIN = 1.5
"""Floors: a held-out error below is that of a form that is right, or as good."""
DURATION_S = 20.0
"""Of each recording."""
FOLDER = Path("docs/discover")


def cases(repeats: int, nothing: int = NOTHING) -> list[tuple[str, str, int]]:
    """Return family, what is hidden and seed of all cases, in turn through the families.

    Args:
        repeats: cases of each effect.
        nothing: cases with nothing hidden.
    """
    known = [
        ("library", name, SEEDS["library"] + 20 * k + i)
        for k in range(repeats)
        for i, name in enumerate((*STATIC, *VELOCITY))
    ]
    outside = [
        ("outside", name, SEEDS["outside"] + 20 * k + i) for k in range(repeats) for i, name in enumerate(OUTSIDE)
    ]
    clean = [("nothing", "", SEEDS["nothing"] + i) for i in range(nothing)]
    ranked = [((i + 0.5) / len(each), case) for each in (known, outside, clean) for i, case in enumerate(each)]
    return [case for _, case in sorted(ranked)]


def line(family: str, hidden: str, seed: int) -> Line:
    """Discover a case's form; return what is kept of it."""
    path = str(Path(__file__).parent / "outside" / f"{hidden}.py") if family == "outside" else hidden
    dirty = family == "nothing" and seed % 2 == 1
    made = hide(seed, effects=[path] if hidden else [], dirty=dirty, duration_s=DURATION_S)
    began_s, cpu_s = time.perf_counter(), time.process_time()
    found = discover(made.fit, made.base, test=made.test, workers=1)
    best = found.found[0].model.errors if found.found else None
    visible = made.answer["visible"]
    return {
        "family": family,
        "hidden": hidden,
        "seed": seed,
        "setting": "dirty" if dirty else "clean",
        "visible": all(each["is_visible"] for each in visible.values()),
        "outcome": found.outcome,
        "forms": [each.form.name for each in found.found],
        "ranked": [each.name for each in found.candidates[:3]],
        "base_rmse_m": found.base.errors.test_rmse_m,
        "best_rmse_m": best.test_rmse_m if best else None,
        "nearest_rmse_m": min((each.model.errors.test_rmse_m for each in found.candidates if each.model), default=None),
        "floor_m": made.answer["floor_m"]["test"],
        "seconds": round(time.perf_counter() - began_s, 1),
        "cpu_seconds": round(time.process_time() - cpu_s, 1),
    }


def succeeds(each: Line) -> bool:
    """Whether a form is believed whose held-out error is within 1.5 floors."""
    return each["best_rmse_m"] is not None and each["best_rmse_m"] <= WITHIN * each["floor_m"]


def report(lines: Sequence[Line]) -> Iterator[str]:
    """Yield the table: a line a case of something hidden, and the sums."""
    for family in ("library", "outside"):
        chosen = [each for each in lines if each["family"] == family and each["visible"]]
        unseen = sum(each["family"] == family and not each["visible"] for each in lines)
        if not chosen:
            continue
        yield f"{family}: found {sum(map(succeeds, chosen))} of {len(chosen)} visible ({unseen} not visible)"
        for each in sorted(chosen, key=lambda each: (each["hidden"], each["seed"])):
            yield f"  {each['hidden']:<24}{each['seed']:<7}{_ratios(each)}  {_said(each)}"
        yield ""
    nothing = [each for each in lines if each["family"] == "nothing"]
    if nothing:
        alarms = sum(bool(each["forms"]) for each in nothing)
        yield f"nothing hidden: {alarms} forms believed in {len(nothing)} recordings"
        for setting in ("clean", "dirty"):
            those = [each for each in nothing if each["setting"] == setting]
            rest = sum(each["outcome"] == "explained" for each in those)
            yield f"  {setting}: {len(those)}, of which {rest} leave nothing to explain, so that no form is sought"
    sought = [each["seconds"] for each in lines if each["outcome"] in {"found", "one_of", "none"}]
    if sought:
        yield f"seconds a case in which forms are sought, median: {np.median(sought):.0f}"


def _ratios(each: Line) -> str:
    floor_m = each["floor_m"]
    best_m = each["best_rmse_m"] or each["nearest_rmse_m"]
    return f"{each['base_rmse_m'] / floor_m:>7.1f} -> {best_m / floor_m if best_m else float('nan'):.2f} floors"


def _said(each: Line) -> str:
    return " = ".join(each["forms"]) if each["forms"] else f"{each['outcome']}"


def _told(each: Line) -> str:
    what = f"{each['family']} {each['hidden']} {each['seed']}: {each['outcome']}"
    return f"{what} {_ratios(each)} {_said(each)}, {each['seconds']} s"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=1, help="of each effect (1)")
    parser.add_argument("--nothing", type=int, default=NOTHING, help=f"cases with nothing hidden ({NOTHING})")
    parser.add_argument("--family", nargs="*", choices=SEEDS, default=list(SEEDS), help="families to run (all)")
    parser.add_argument("--cases", type=int, help="run at most so many now (all)")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes (one a core)")
    parser.add_argument("--out", type=Path, default=FOLDER, help="where a line a case is kept")
    parser.add_argument("--table", action="store_true", help="run nothing, print the table")
    arguments = parser.parse_args()
    file = arguments.out / "cases.jsonl"
    lines = kept(file)
    there = {each["seed"] for each in lines}
    todo = [
        each
        for each in cases(arguments.repeats, arguments.nothing)
        if each[0] in arguments.family and each[2] not in there
    ]
    todo = [] if arguments.table else todo[: arguments.cases]
    for each in run(file, line, todo, arguments.workers):
        lines.append(each)
        print(_told(each), flush=True)
    print(*report(lines), sep="\n")


if __name__ == "__main__":
    main()

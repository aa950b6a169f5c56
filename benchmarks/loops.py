"""Stiction from OP, PV and SP: how often it is told rightly. `python -m benchmarks.loops [--data FOLDER] [--drawn N]`.

    drawn loops    with truth (`benchmarks.drawn_loops`), of seeds that did not calibrate
    FOLDER         loops of others with labels, fetched by whoever runs it: labels.csv (file, loop, sticks, set) and
                   files (time_s, op_pct or op, pv, sp); by loop, never by window

Every method gives a score a loop, higher where it says sticks. `--out FILE` writes them; `--scores FILE` judges those
of another method in the same form: a CSV file of set, loop, sticks, method, score. `--calibrate` prints what
`workbench.loops.calibration` and `LIMITS.least_interval` hold, from N loops of the seeds from 1000 on.
"""

import argparse
import csv
import time
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import cast

import numpy as np
from numba import njit

from benchmarks.drawn_loops import CAUSES, Array, DrawnLoop, Simulate, Truth, draw_loop, draw_loops, simulate
from workbench.loops import LoopDiagnosis, LoopRecord, diagnose_loop
from workbench.loops.calibration import CALIBRATION, Evidence, calibrate, mean_evidence
from workbench.loops.joint import together
from workbench.loops.oscillation import find_oscillation
from workbench.loops.shape_methods import he
from workbench.loops.thresholds import LIMITS

OURS = "likelihood"
METHODS = (OURS, "He", "Hagglund", "Horch", "Kano")
CALIBRATION_SEEDS = 1000
FRESH_SEEDS = 4000
"""Of the loops that are counted: those of 0 to 299, 1000 to 1299 and 3000 to 3299 were looked at."""


@dataclass(frozen=True, slots=True)
class Judged:
    """A loop and what was said of it."""

    truth: Truth
    verdict: str
    gated: str
    evidence: Evidence
    stiction_pct: float
    low_pct: float
    high_pct: float
    scores: dict[str, float]
    seconds: float


@dataclass(frozen=True, slots=True)
class Score:
    """A line of the results file."""

    set: str
    loop: str
    sticks: int
    method: str
    score: float


def judge(loop: DrawnLoop) -> Judged:
    begin_s = time.process_time()
    found = diagnose_loop(LoopRecord.of_samples("drawn", loop.time_s, loop.op_pct, loop.pv, loop.sp))
    friction = found.causes.friction if found.causes else None
    scores = {vote.method: vote.index for vote in found.votes}
    return Judged(
        loop.truth,
        found.verdict,
        found.gates[0].code if found.gates else "",
        found.evidence,
        friction.stiction_pct if friction else 0.0,
        friction.low_pct if friction else 0.0,
        friction.high_pct if friction else 0.0,
        {OURS: CALIBRATION.probability(found.evidence)} | scores,
        time.process_time() - begin_s,
    )


def judged(count: int, first_seed: int) -> list[Judged]:
    loops = list(draw_loops(count, cast(Simulate, njit(simulate)), first_seed=first_seed))
    with ProcessPoolExecutor() as pool:
        return list(pool.map(judge, loops, chunksize=4))


def area(scores: Sequence[float], sticks: Sequence[int]) -> float:
    """Return the area under the ROC curve: how often a sticking loop has more than another, half for a tie."""
    ours, others = ([s for s, each in zip(scores, sticks, strict=True) if each == which] for which in (1, 0))
    return float(np.mean([(a > b) + 0.5 * (a == b) for a in ours for b in others])) if ours and others else np.nan


def of_drawn(found: Sequence[Judged]) -> Iterator[str]:
    called = [each for each in found if each.verdict == "sticks"]
    right = [each for each in called if each.truth.cause == "sticks"]
    of = sum(each.truth.cause == "sticks" for each in found)
    yield f"drawn loops: {len(found)}, {of} stick; {np.mean([each.seconds for each in found]):.2f} s of a core each"
    yield f"  called sticking: {len(called)}, wrong {share(len(called) - len(right), len(called))}"
    ratios = np.array([each.stiction_pct / each.truth.stiction_pct for each in right])
    inside = sum(each.low_pct <= each.truth.stiction_pct <= each.high_pct for each in right)
    yield (
        f"  of those rightly called: within 20 % {share(int((np.abs(ratios - 1.0) <= 0.2).sum()), ratios.size)}, "
        f"in the interval {share(inside, ratios.size)}"
    )
    yield f"  {'truth':20}{'loops':>6}{'sticks':>8}{'else':>6}{'open':>6}{'insufficient':>14}"
    for cause in CAUSES:
        mine = [each for each in found if each.truth.cause == cause]
        counts = [sum(each.verdict == said for each in mine) for said in ("sticks", "something else")]
        gated = sum(bool(each.gated) for each in mine)
        yield f"  {cause:20}{len(mine):6}{counts[0]:8}{counts[1]:6}{len(mine) - sum(counts) - gated:6}{gated:14}"


def of_a_day() -> str:
    """Return how long a day at one sample a second takes: a drawn loop there and back, again and again, and noise."""
    loop = draw_loop(10, "sticks", cast(Simulate, njit(simulate)))
    rng = np.random.default_rng(0)

    def long(values: Array) -> Array:
        return np.resize(np.concatenate([values, values[::-1]]), DAY)

    time_s = np.arange(float(DAY))
    pv = long(loop.pv) + 0.05 * rng.standard_normal(DAY)
    begin_s = time.process_time()
    diagnose_loop(LoopRecord.of_samples("day", time_s, long(loop.op_pct), pv, long(loop.sp)))
    return f"a day at 1 s: {time.process_time() - begin_s:.1f} s of a core"


DAY = 86_400


def share(part: int, whole: int) -> str:
    return f"{part}/{whole} = {100.0 * part / whole:.0f} %" if whole else "0/0"


Key = tuple[str, str, int]
"""Set, loop, label."""


def labelled(folder: Path) -> Iterator[tuple[Key, dict[str, str], dict[str, Array]]]:
    """Yield key, line and columns of each record with a label."""
    with (folder / "labels.csv").open(encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["sticks"] in ("0", "1")]
    for row in rows:
        columns = np.genfromtxt(folder / row["file"], delimiter=",", names=True)
        named = {name: columns[name] for name in columns.dtype.names or ()}
        yield (row["set"], row["loop"], int(row["sticks"])), row, named


def diagnosed(folder: Path) -> dict[Key, list[LoopDiagnosis]]:
    """Return the diagnoses of each labelled loop's records."""
    found: dict[Key, list[LoopDiagnosis]] = defaultdict(list)
    for key, _, columns in labelled(folder):
        if "pv" in columns:
            samples = (columns[name] for name in ("time_s", "op_pct", "pv", "sp"))
            found[key].append(diagnose_loop(LoopRecord.of_samples(key[1], *samples)))
    return found


def of_labelled(folder: Path) -> list[Score]:
    """Return the scores of loops with labels: OP, PV and SP, or OP alone, which only He's method reads.

    Of the other methods the median of a loop's windows is taken.
    """
    windows: dict[Key, list[dict[str, float]]] = defaultdict(list)
    for key, row, columns in labelled(folder):
        if "pv" not in columns:
            period_s = float(np.median(np.diff(columns["time_s"])))
            found = find_oscillation(columns["op"], period_s)
            windows[key].append({"He": he(columns["op"], found.period_s / period_s).index})
        elif row.get("plant_index"):
            windows[key].append({"plant's own index": float(row["plant_index"])})
    scores = []
    for key, said in diagnosed(folder).items():
        joint = together(said)
        scores.append(Score(*key, OURS, CALIBRATION.probability(evidence_of(said))))
        windows[key] += [{vote.method: vote.index for vote in each.votes} for each in said]
        print(f"  {'sticks' if key[2] else '':7}{joint.sentence}")
    for key, of_loop in windows.items():
        for method in dict.fromkeys(name for window in of_loop for name in window):
            known = [window[method] for window in of_loop if method in window]
            scores.append(Score(*key, method, float(np.median(known))))
    return scores


def between(scores: Sequence[float], sticks: Sequence[int]) -> tuple[float, float]:
    """Return the 95 % interval of the area, by loops drawn anew."""
    rng = np.random.default_rng(0)
    ours, others = (np.array([s for s, each in zip(scores, sticks, strict=True) if each == which]) for which in (1, 0))
    wins = (ours[:, None] > others) + 0.5 * (ours[:, None] == others)
    again = [
        wins[np.ix_(rng.integers(0, ours.size, ours.size), rng.integers(0, others.size, others.size))].mean()
        for _ in range(2000)
    ]
    return float(np.quantile(again, 0.025)), float(np.quantile(again, 0.975))


def areas(scores: Sequence[Score]) -> Iterator[str]:
    """Yield the area of each method on each set, by loop."""
    for name in dict.fromkeys(each.set for each in scores):
        of_set = [each for each in scores if each.set == name]
        loops = {each.loop: each.sticks for each in of_set}
        yield f"{name}: {len(loops)} loops, {sum(loops.values())} stick"
        for method in dict.fromkeys(each.method for each in of_set):
            mine = [each for each in of_set if each.method == method]
            called = [each for each in mine if each.score >= LIMITS.sticks_probability]
            wrong = sum(not each.sticks for each in called)
            told = f"; called {len(called)}, wrong {wrong}" if method == OURS else ""
            low, high = between(values := [e.score for e in mine], sticks := [e.sticks for e in mine])
            yield f"  {method:20} AUC {area(values, sticks):.2f} ({low:.2f} to {high:.2f}){told}"


def calibration(found: Sequence[Judged], folder: Path | None) -> Iterator[str]:
    """Yield what the calibration is, and how often it is wrong; drawn and labelled loops weigh the same together."""
    kept = [each for each in found if not each.gated]
    loops = [each.evidence for each in kept]
    sticks = [float(each.truth.cause == "sticks") for each in kept]
    plants = list(of_plants(folder)) if folder else []
    weights = np.concatenate([np.full(len(loops), max(1, len(plants)) / len(loops)), np.ones(len(plants))])
    told, truth = [*loops, *(each for each, _ in plants)], np.array([*sticks, *(label for _, label in plants)])
    fitted = calibrate(told, truth, weights)
    yield f"{len(loops)} drawn loops, {len(plants)} labelled: {fitted}"
    probability = np.array([fitted.probability(each) for each in loops])
    for least in (0.8, 0.85, 0.9, 0.92, 0.95, 0.97):
        called = probability >= least
        yield f"  at {least:g}: called {called.sum()}, wrong {int((called & (np.array(sticks) == 0.0)).sum())}"
    off = [
        abs(np.log(each.stiction_pct / each.truth.stiction_pct))
        for each, p in zip(kept, probability, strict=True)
        if p >= LIMITS.sticks_probability and each.truth.cause == "sticks"
    ]
    yield f"  95 % of those called lie within {np.quantile(off, 0.95):.3f} in logarithm" if off else "  none called"
    if plants:
        yield f"  labelled, by pairs left out: AUC {of_pairs(told, truth, weights, len(loops)):.2f}"


def of_pairs(told: Sequence[Evidence], truth: Array, weights: Array, first: int) -> float:
    """Return how often, of a sticking and another labelled loop, the first has more, calibrated without the two.

    Left out one by one they would be judged by two calibrations, that of a sticking loop with fewer that stick.
    """
    wins = []
    for ours, other in product(*(first + np.flatnonzero(truth[first:] == which) for which in (1.0, 0.0))):
        kept = np.setdiff1d(np.arange(truth.size), (ours, other))
        fitted = calibrate([told[at] for at in kept.tolist()], truth[kept], weights[kept])
        a, b = fitted.probability(told[int(ours)]), fitted.probability(told[int(other)])
        wins.append((a > b) + 0.5 * (a == b))
    return float(np.mean(wins))


def of_plants(folder: Path) -> Iterator[tuple[Evidence, float]]:
    """Yield the evidence and the label of each labelled loop."""
    for key, found in diagnosed(folder).items():
        yield evidence_of(found), float(key[2])


def evidence_of(found: Sequence[LoopDiagnosis]) -> Evidence:
    """Return the evidence of a loop's records: of those that tell, or the phase alone where none does."""
    return mean_evidence([each.evidence for each in found if each.causes] or [each.evidence for each in found])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drawn", type=int, default=300, metavar="N")
    parser.add_argument("--first-seed", type=int, default=FRESH_SEEDS, metavar="SEED")
    parser.add_argument("--data", type=Path, metavar="FOLDER")
    parser.add_argument("--out", type=Path, metavar="FILE")
    parser.add_argument("--scores", type=Path, metavar="FILE")
    parser.add_argument("--calibrate", action="store_true")
    arguments = parser.parse_args()
    if arguments.scores:
        with arguments.scores.open(encoding="utf-8") as file:
            lines = list(csv.DictReader(file))
        rows = [Score(r["set"], r["loop"], int(r["sticks"]), r["method"], float(r["score"])) for r in lines]
        print(*areas(rows), sep="\n")
        return
    if arguments.calibrate:
        print(*calibration(judged(arguments.drawn, CALIBRATION_SEEDS), arguments.data), sep="\n")
        return
    scores: list[Score] = []
    if arguments.drawn:
        found = judged(arguments.drawn, arguments.first_seed)
        print(*of_drawn(found), of_a_day(), sep="\n")
        scores += [
            Score("drawn", str(each.truth.seed), int(each.truth.cause == "sticks"), method, each.scores[method])
            for each in found
            for method in METHODS
            if method in each.scores
        ]
    if arguments.data:
        scores += of_labelled(arguments.data)
    print(*areas(scores), sep="\n")
    if arguments.out:
        with arguments.out.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(("set", "loop", "sticks", "method", "score"))
            writer.writerows((s.set, s.loop, s.sticks, s.method, f"{s.score:.6g}") for s in scores)


if __name__ == "__main__":
    main()

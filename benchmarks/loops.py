"""The calibration of the loops' evidence: `python -m benchmarks.loops [--drawn N] [--data FOLDER]`.

It prints what `workbench.loops.calibration` and `LIMITS.least_interval` hold, from N drawn loops of the seeds from 1000
on and from FOLDER, loops of others with labels (`positioner bench --labelled`), each set counted as much as the other;
and how long a day at one sample a second takes. How often a verdict is right on other loops says `positioner bench`.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from workbench.bench.cases import Case, read_cases, write_cases
from workbench.bench.drawn_loops import Array, draw_loop
from workbench.bench.methods import evidence_of, loop_records
from workbench.loops import LoopRecord, diagnose_loop
from workbench.loops.calibration import Evidence, calibrate
from workbench.loops.thresholds import LIMITS

CALIBRATION_SEEDS = 1000
DAY = 86_400


@dataclass(frozen=True, slots=True)
class Told:
    """A loop's evidence, whether it sticks, whether a record of it could be judged, and S found of S, or None."""

    evidence: Evidence
    sticks: bool
    drawn: bool
    judged: bool
    size_ratio: float | None


def tell(case: Case) -> Told | None:
    said = [diagnose_loop(each) for each in loop_records(case)]
    if not said:
        return None
    friction = said[0].causes.friction if said[0].causes else None
    ratio = friction.stiction_pct / case.stiction_pct if friction and case.stiction_pct else None
    judged = any(each.causes for each in said)
    return Told(evidence_of(said), case.truth == "1", case.set == "drawn", judged, ratio)


def calibration(told: Sequence[Told]) -> Iterator[str]:
    """Yield what the calibration is, and how often it is wrong."""
    drawn = [each for each in told if each.drawn and each.judged]
    plants = [each for each in told if not each.drawn]
    weights = np.concatenate([np.full(len(drawn), max(1, len(plants)) / len(drawn)), np.ones(len(plants))])
    loops, truth = [each.evidence for each in drawn + plants], np.array([float(e.sticks) for e in drawn + plants])
    fitted = calibrate(loops, truth, weights)
    yield f"{len(drawn)} drawn loops, {len(plants)} labelled: {fitted}"
    probability = np.array([fitted.probability(each.evidence) for each in drawn])
    for least in (0.8, 0.85, 0.9, 0.92, 0.95, 0.97):
        called = probability >= least
        yield f"  at {least:g}: called {called.sum()}, wrong {int((called & (truth[: len(drawn)] == 0.0)).sum())}"
    off = [
        abs(np.log(each.size_ratio))
        for each, p in zip(drawn, probability, strict=True)
        if p >= LIMITS.sticks_probability and each.size_ratio
    ]
    yield f"  95 % of those called lie within {np.quantile(off, 0.95):.3f} in logarithm" if off else "  none called"
    if plants:
        yield f"  labelled, by pairs left out: AUC {of_pairs(loops, truth, weights, len(drawn)):.2f}"


def of_pairs(told: Sequence[Evidence], truth: Array, weights: Array, first: int) -> float:
    """Return how often, of a sticking and another labelled loop, the first has more, calibrated without the two.

    Left out one by one they would be judged by two calibrations, that of a sticking loop with fewer that stick.
    """
    wins = []
    for ours, other in product(*((first + np.flatnonzero(truth[first:] == which)).tolist() for which in (1.0, 0.0))):
        kept = np.setdiff1d(np.arange(truth.size), (ours, other))
        fitted = calibrate([told[at] for at in kept.tolist()], truth[kept], weights[kept])
        a, b = fitted.probability(told[ours]), fitted.probability(told[other])
        wins.append((a > b) + 0.5 * (a == b))
    return float(np.mean(wins))


def of_a_day() -> str:
    """Return how long a day at one sample a second takes: a drawn loop there and back, again and again, and noise."""
    loop = draw_loop(10, "sticks")
    rng = np.random.default_rng(0)

    def long(values: Array) -> Array:
        return np.resize(np.concatenate([values, values[::-1]]), DAY)

    time_s = np.arange(float(DAY))
    pv = long(loop.pv) + 0.05 * rng.standard_normal(DAY)
    begin_s = time.process_time()
    diagnose_loop(LoopRecord.of_samples("day", time_s, long(loop.op_pct), pv, long(loop.sp)))
    return f"a day at 1 s: {time.process_time() - begin_s:.1f} s of a core"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--drawn", type=int, default=300, metavar="N")
    parser.add_argument("--data", type=Path, metavar="FOLDER")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        write_cases(Path(folder), arguments.drawn, 0, CALIBRATION_SEEDS, arguments.data)
        with ProcessPoolExecutor() as pool:
            told = list(pool.map(tell, read_cases(Path(folder)), chunksize=4))
    print(*calibration([each for each in told if each]), of_a_day(), sep="\n")


if __name__ == "__main__":
    main()

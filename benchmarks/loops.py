"""The calibration of the loops' evidence: `python -m benchmarks.loops [--drawn N] [--data FOLDER]`.

It prints what `workbench.loops.calibration`, `LIMITS.sticks_probability` and `LIMITS.size_within` hold: three
numbers from N drawn loops of the seeds from 1000 on, and of N others of the seeds from 2000 on how many are wrong. Of
FOLDER, loops of others with labels (`positioner bench --labelled`), none calibrates anything: it prints how well they
are told. How often a verdict is right on further loops says `positioner bench`. Last comes how long a day at one sample
a second takes.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from workbench.bench.cases import Case, read_cases, write_cases
from workbench.bench.drawn_loops import Array, draw_loop
from workbench.bench.methods import evidence_of, loop_records
from workbench.bench.scores import area
from workbench.loops import LoopRecord, diagnose_loop
from workbench.loops.calibration import Calibration, Evidence
from workbench.loops.causes import Size
from workbench.loops.loop_thresholds import LIMITS

NUMBERS, THRESHOLD = 1000, 2000
"""First seeds of the loops that the three numbers and the threshold are from."""
OF_A_PLANT = 0.2
"""Share of a plant's loops that stick: a fifth to a third, by the literature."""
DAY = 86_400


@dataclass(frozen=True, slots=True)
class Told:
    """A loop's evidence, whether it sticks, whether a record of it could be judged, S as found, and S, %."""

    evidence: Evidence
    sticks: bool
    judged: bool
    size: Size | None
    stiction_pct: float | None


def calibrate(loops: Sequence[Evidence], sticks: Array) -> Calibration:
    """Return the calibration of n loops; `sticks`, (n,), is 1 or 0. By Newton's method, weakly regularised."""
    features = np.array([(1.0, each.pv.weight, each.output.weight) for each in loops])
    found = np.zeros(3)
    penalty = np.diag([0.0, 0.05, 0.05])
    for _ in range(50):
        says = 1.0 / (1.0 + np.exp(-np.clip(features @ found, -30.0, 30.0)))
        slope = features.T @ (sticks - says) - penalty @ found
        curvature = (features * (says * (1.0 - says))[:, None]).T @ features + penalty
        found = found + np.linalg.solve(curvature, slope)
    return Calibration(*found.tolist())


def tell(case: Case) -> Told | None:
    said = [diagnose_loop(each) for each in loop_records(case)]
    if not said:
        return None
    size = said[0].causes.friction.size if said[0].causes else None
    return Told(evidence_of(said), case.truth == "1", any(each.causes for each in said), size, case.stiction_pct)


def told_of(pool: ProcessPoolExecutor, drawn: int, first_seed: int, labelled: Path | None) -> list[Told]:
    with tempfile.TemporaryDirectory() as folder:
        write_cases(Path(folder), drawn, 0, first_seed, labelled)
        return [each for each in pool.map(tell, read_cases(Path(folder)), chunksize=4) if each]


def scored(told: Sequence[Told], by: Calibration) -> tuple[Array, np.ndarray]:
    return np.array([by.probability(each.evidence) for each in told]), np.array([each.sticks for each in told])


def most_wrong(called: np.ndarray, sticks: np.ndarray) -> float:
    """Return the share of those called that is wrong at most, in a plant of which one loop in five sticks.

    Conformal selection: one more is taken for wrong, and others count as often as a plant has them.
    """
    weight = sticks.sum() / (~sticks).sum() * (1.0 / OF_A_PLANT - 1.0)
    wrong = weight * (1 + (called & ~sticks).sum())
    return float(wrong / ((called & sticks).sum() + wrong))


def counted(said: np.ndarray, wrong: np.ndarray) -> str:
    return f"{said.sum()} said so, {(said & wrong).sum()} wrong"


def calibration(numbers: Sequence[Told], others: Sequence[Told], labelled: Sequence[Told]) -> Iterator[str]:
    """Yield what the calibration is, and how well it tells loops that it was not made from."""
    fitted = calibrate([e.evidence for e in numbers], np.array([float(e.sticks) for e in numbers]))
    least = LIMITS.sticks_probability
    scores, sticks = scored(others, fitted)
    yield f"{len(numbers)} drawn loops: {fitted}"
    yield f"{len(others)} others: AUC {area(scores, sticks):.3f}"
    of_a_plant = 100 * most_wrong(scores >= least, sticks)
    yield f"from {least:g} on: {counted(scores >= least, ~sticks)}; in a plant {of_a_plant:.1f} % at most"
    yield f"below {LIMITS.other_probability:g}: {counted(scores < LIMITS.other_probability, sticks)}"
    found = [(e.size, e.stiction_pct) for e, p in zip(others, scores, strict=True) if p >= least and e.stiction_pct]
    yield from sizes([(size, s_pct) for size, s_pct in found if size])
    if labelled:
        scores, sticks = scored(labelled, fitted)
        yield f"{len(labelled)} labelled: AUC {area(scores, sticks):.3f}, {counted(scores >= least, ~sticks)}"


def sizes(found: Sequence[tuple[Size, float]]) -> Iterator[str]:
    """Yield how near S is to that of drawn loops."""
    off = [abs(size.stiction_pct / s_pct - 1.0) for size, s_pct in found if size.told]
    held = sum(size.low_pct <= s_pct <= size.high_pct for size, s_pct in found)
    yield f"S is in its interval in {held} of {len(found)}, told of {len(off)}"
    yield f"95 % of these lie within {np.quantile(off, 0.95):.3f} of it" if off else "none is told"


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
    with ProcessPoolExecutor() as pool:
        numbers, others = (
            [each for each in told_of(pool, arguments.drawn, seed, None) if each.judged]
            for seed in (NUMBERS, THRESHOLD)
        )
        labelled = told_of(pool, 0, 0, arguments.data) if arguments.data else []
    print(*calibration(numbers, others, labelled), of_a_day(), sep="\n")


if __name__ == "__main__":
    main()

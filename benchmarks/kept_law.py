"""What the law of slides does on twelve drawn valves, kept, so that a change of it is seen: `make moved`.

    python -m benchmarks.kept_law [--keep]      prints what moved; --keep: and keeps what the law does now

The valves are those of `benchmarks.real_valves` from seed 40000 on that are played quickly: a cycle of at least 5 ms, a
lag of at most 0.15 s. Of each, a line says which share of its steps landed, and what a step took on average: slides,
travel beyond the move, time until its last slide.
"""

import argparse
import json
import logging
from collections.abc import Iterator
from itertools import count, islice
from pathlib import Path

import numpy as np

from benchmarks.kept_lines import Line, kept
from benchmarks.real_valves import drawn, outcome

LINES_FILE = Path("tests/change_indication/law.jsonl")
FIRST_SEED, VALVES_PLAYED, STEPS_A_VALVE = 40000, 12, 5
"""Seed of the first that is looked at; valves and steps: some 7 s on one core, most of it S3."""
SHORTEST_PERIOD_S, LONGEST_LAG_S = 5e-3, 0.15
"""Others take 2 to 9 s each."""
FIGURE_TOLERANCE = 1e-6
"""Of a figure: friction and noise larger by 1e-6 move a mean excursion by 5e-9 at the most, and nothing else."""
FIGURES = ("landed", "slides", "beyond", "took_s")


def seeds() -> Iterator[int]:
    """Yield the seeds of valves that are played quickly."""
    for seed in count(FIRST_SEED):
        each = drawn(np.random.default_rng(seed))
        if each.period_s >= SHORTEST_PERIOD_S and each.lag_s <= LONGEST_LAG_S:
            yield seed


def line(seed: int) -> Line:
    """Return what the law does on a valve."""
    _, found = outcome(seed, STEPS_A_VALVE)
    beyond, slides, took_s = np.mean(found.taken, axis=0).tolist()
    return {"seed": seed, "landed": float(np.mean(found.landed)), "slides": slides, "beyond": beyond, "took_s": took_s}


def changes(before: Line, after: Line) -> list[str]:
    """Return what a valve does otherwise than before."""
    moved = (each for each in FIGURES if not abs(after[each] - before[each]) <= FIGURE_TOLERANCE)
    return [f"{each} {before[each]:.6g} to {after[each]:.6g}" for each in moved]


def main() -> None:
    logging.disable(logging.CRITICAL)  # each lost reply has its line
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--keep", action="store_true", help="keep what the law does now")
    arguments, before = parser.parse_args(), {each["seed"]: each for each in kept(LINES_FILE)}
    lines = [line(seed) for seed in islice(seeds(), VALVES_PLAYED)]
    for each in lines:
        then = before.get(each["seed"])
        said = ["new"] if then is None else changes(then, each) or ["as before"]
        print(f"valve {each['seed']}: {'; '.join(said)}")
    if arguments.keep:
        LINES_FILE.write_text("".join(f"{json.dumps(each)}\n" for each in lines), encoding="utf-8")


if __name__ == "__main__":
    main()

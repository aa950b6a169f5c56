"""How far up the right effect stands in the first ranking, which is there before any effect is fitted.

    python -m benchmarks.first_ranking [--seeds FROM TO]

One effect is hidden in a drawn valve, clean and dirty; cases in which the valve without it reaches 1.3 floors,
refitted, are left out. An effect of the same algebraic class counts as the right one: no record tells it.
"""

import argparse
import time
from collections.abc import Iterator, Mapping, Sequence
from itertools import product

import numpy as np

from sim.effect import Effect, first_effects, shipped_effect
from workbench.blind.hiding import hide
from workbench.data.held_out import split
from workbench.fit.fit_problem import problem
from workbench.fit.fitting import base_fit
from workbench.select.equivalence import algebraic_class
from workbench.select.tangent_preview import preview

SEEDS = (20100, 20125)
VISIBLE = 1.3
"""Floors that the valve leaves at least without the hidden effect."""


def places(seeds: Sequence[int], library: Mapping[str, Effect]) -> Iterator[tuple[int, float]]:
    """Yield the place of the right effect, from 1, and the seconds that the ranking took; a line a case is printed."""
    for seed, dirty in product(seeds, (False, True)):
        hidden = hide(seed, dirty=dirty)
        (effect,) = (each.name for each in hidden.truth.effect)
        parts = split([hidden.fit], hidden.test)
        of = problem(parts.train.record, hidden.base.valve)
        base = base_fit(of, hidden.base)
        if effect not in library or parts.floor_m is None or base.rms_m < VISIBLE * parts.floor_m:
            continue
        begun_s = time.perf_counter()
        ranked = [each.name for each in preview(base, of, library)]
        took_s = time.perf_counter() - begun_s
        place = 1 + min(ranked.index(each) for each in algebraic_class(effect, library) if each in ranked)
        print(
            f"{seed} {'dirty' if dirty else 'clean'} {effect:24}{place:3}  before it: {' '.join(ranked[: place - 1])}"
        )
        yield place, took_s


def main() -> None:
    """Print a line a case, and in how many the right effect stands how far up."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs=2, default=SEEDS, metavar=("FROM", "TO"))
    library = {name: shipped_effect(name, "library") for name in first_effects()}
    found = np.array(list(places(range(*parser.parse_args().seeds), library)))
    shares = ", ".join(f"in the first {many} in {100 * np.mean(found[:, 0] <= many):.0f} %" for many in (1, 3, 5))
    print(
        f"{len(found)} cases: {shares}; {np.median(found[:, 1]):.2f} s in the median, {found[:, 1].max():.2f} s at most"
    )


if __name__ == "__main__":
    main()

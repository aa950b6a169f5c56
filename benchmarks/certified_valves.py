"""Does a valve violate its certificate? Valves drawn inside the intervals of certified ones, under the law itself.

    python -m benchmarks.certified_valves [--valves 10000] [--moves 8] [--seed 0]

For each valve intervals are drawn (break-away to 8 % of the stroke, known within a factor of 1 to 3; balance known
within 0.1 % and scatter to 0.03 % of the stroke), and the law is asked for its certificate. Where it gives one, a valve
is drawn inside them, half of the time at their ends, and makes small moves under the law of the daemon
(`tests.control.scripted_stem`). Counted is who ends elsewhere, takes more slides or goes farther beyond than is proved,
or moves when left alone. Then come laws that are bad on purpose: each must be refused wherever the good one is not.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from positioner.control.laws.slides.certificate import Certificate, KnownValve, Refused, certified
from positioner.control.laws.slides.slide_balance import Balance
from positioner.control.laws.slides.slide_bounds import SlideBounds
from positioner.control.laws.slides.states import Idle
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval
from tests.control.scripted_stem import SETTINGS, SLOPE_PA_PER_M, STROKE_M, ScriptedStem

LONGEST, KNOWN_WITHIN, GIVES = 0.08, 3.0, 0.02
BALANCE, SCATTER = 1e-3, 3e-4
FRICTION = (1.5, 3.0)
"""Of the break-away distance."""
ALONE_S = 600.0
ROUNDING_M = 1e-9
BAD_LAWS = {
    "the way back is as long as has broken loose, and no longer": replace(SETTINGS.thresholds, return_margin=1.0),
    "the way back is shorter": replace(SETTINGS.thresholds, return_margin=0.9),
    "a move has two slides": replace(SETTINGS.thresholds, most_slides=1),
}
OVERSHOOTS = -0.6
"""w_0 with which what a slide missed is corrected by 2.5 times that."""


@dataclass
class DrawnInside(ScriptedStem):
    """A stem whose slides scatter within a bound, of which the law knows the balance amiss."""

    off_m: tuple[float, float] = (0.0, 0.0)
    """By how much, down and up."""

    def scattered_m(self) -> float:
        ends = self.rng.random() < 0.5
        return self.scatter_m * float(self.rng.choice((-1.0, 1.0)) if ends else self.rng.uniform(-1.0, 1.0))

    @property
    def balance(self) -> Balance:
        down_pa, up_pa = (
            each + SLOPE_PA_PER_M * off_m for each, off_m in zip((self.down_pa, self.up_pa), self.off_m, strict=True)
        )
        ratios = Ratios(-SLOPE_PA_PER_M, -0.5 * (up_pa + down_pa), 0.5 * (up_pa - down_pa))
        return Balance(ratios, tuple(self.landings[:20]), tuple(self.held[:20]), STROKE_M, now_s=self.now_s)


def drawn_known(rng: np.random.Generator) -> KnownValve:
    """Draw intervals of a valve."""
    onward_m = STROKE_M * float(np.exp(rng.uniform(np.log(0.01), np.log(LONGEST))))
    turning_m = onward_m + STROKE_M * float(rng.choice((0.0, 1.0)) * rng.uniform(0.0, GIVES))
    onward, turning = (
        Interval(each_m / float(rng.uniform(1.01, KNOWN_WITHIN)), each_m, seen=True) for each_m in (onward_m, turning_m)
    )
    return KnownValve(
        balance_m=STROKE_M * float(rng.uniform(0.0, BALANCE)),
        scatter_m=STROKE_M * float(rng.uniform(0.0, SCATTER)),
        distances=BreakawayDistance(onward, onward, turning, turning),
        friction_m=turning_m * float(rng.uniform(*FRICTION)),
    )


def drawn_inside(known: KnownValve, rng: np.random.Generator) -> DrawnInside:
    """Draw a valve inside intervals."""

    def inside(interval: Interval) -> float:
        return float(interval.broke_m if rng.random() < 0.5 else rng.uniform(interval.held_m, interval.broke_m))

    friction_pa = SLOPE_PA_PER_M * known.friction_m
    preload_pa = friction_pa * float(rng.uniform(-0.2, 0.2))
    onward_m = inside(known.distances.onward_up)
    stem = DrawnInside(
        SETTINGS,
        up_pa=friction_pa + preload_pa,
        down_pa=friction_pa - preload_pa,
        onward_m=onward_m,
        turning_m=inside(known.distances.turning_up),
        scatter_m=known.scatter_m,
        rng=rng,
        off_m=tuple(known.balance_m * rng.choice((-1.0, 1.0), 2) * rng.uniform(0.5, 1.0, 2)),
    )
    stem.memory = replace(stem.memory, distances=known.distances)
    return stem


def violated(stem: DrawnInside, found: Certificate, moves: int) -> Iterator[str]:
    """Yield what a stem does that is proved it does not."""
    for _ in range(moves):
        way_m = STROKE_M * float(np.exp(stem.rng.uniform(np.log(1e-3), np.log(0.1))) * stem.rng.choice((-1, 1)))
        from_m = stem.position_m
        to_m = from_m + way_m if 0.35 < (from_m + way_m) / STROKE_M < 0.65 else from_m - way_m
        farthest: list[float] = []
        slides, still = 0, 0
        while still < 6:
            before_pa = stem.memory.command_pa
            stem.once(to_m)
            changed = stem.memory.command_pa != before_pa
            slides, still = slides + changed, 0 if changed else still + 1
            farthest.append(max(min(from_m, to_m) - stem.position_m, stem.position_m - max(from_m, to_m)))
        if slides > found.most_slides:
            yield f"{slides} slides, and {found.most_slides} are proved"
        if max(farthest) > found.beyond_m + ROUNDING_M:
            yield f"{1e3 * max(farthest):.3g} mm beyond, and {1e3 * found.beyond_m:.3g} are proved"
        if abs(stem.position_m - to_m) > found.ends_within_m + ROUNDING_M or not isinstance(stem.memory.state, Idle):
            yield f"ends {1e3 * abs(stem.position_m - to_m):.3g} mm off, {1e3 * found.ends_within_m:.3g} are proved"
        left_pa = stem.memory.command_pa
        for _ in range(3):
            stem.now_s += ALONE_S
            stem.once(to_m)
        if stem.memory.command_pa != left_pa:
            yield "moves when left alone"


def wrongly_given(known: KnownValve) -> Iterator[str]:
    """Yield the bad laws that are given a certificate on a valve."""
    for name, thresholds in BAD_LAWS.items():
        bounds: SlideBounds = replace(SETTINGS, thresholds=thresholds)
        if not isinstance(certified(known, bounds), Refused):
            yield name
    if not isinstance(certified(known, SETTINGS, held_back=OVERSHOOTS), Refused):
        yield "what a slide missed is corrected by more than twice that"


def report(valves: int, moves: int, seed: int) -> Iterator[str]:
    """Yield lines."""
    refused, bad = Counter[str](), Counter[str]()
    given, slides, left = 0, [], []
    for number in range(valves):
        rng = np.random.default_rng([seed, number])
        known = drawn_known(rng)
        found = certified(known, SETTINGS)
        if isinstance(found, Refused):
            refused[found.parameter.split(":")[0]] += 1
            continue
        given += 1
        slides.append(found.most_slides)
        left += [f"valve {number}: {each}" for each in violated(drawn_inside(known, rng), found, moves)]
        bad.update(wrongly_given(known))
    yield f"{valves} valves: certified {given}; not proved, for want of {dict(refused)}"
    if slides:
        yield f"slides a step at the most: median {np.median(slides):.0f}, largest {max(slides)}"
    yield f"violated certificates: {len({each.split(':')[0] for each in left})} of {given}"
    yield from left[:10]
    yield f"bad laws that were given one: {dict(bad)}"


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valves", type=int, default=10_000)
    parser.add_argument("--moves", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    for line in report(arguments.valves, arguments.moves, arguments.seed):
        print(line, flush=True)


if __name__ == "__main__":
    main()

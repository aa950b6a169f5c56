"""Does a valve violate its certificate? Valves drawn inside the intervals of certified ones, under the law itself.

    python -m benchmarks.certified_valves [--valves 10000] [--moves 8] [--seed 0]

For each valve intervals are drawn (break-away to 8 % of the stroke, known within a factor of 1 to 1.5; the balance
within 0.05 % of the stroke and its scatter to 0.02 %), and the law is asked for its certificate. Where it gives one, a
valve is drawn inside them, often at their ends: how far slides land off and break-away go over the travel as waves or
steps of any length. It makes small moves under the law of the daemon (`tests.control.scripted_stem`). Counted is who
ends elsewhere, takes more slides or goes farther beyond than is proved, moves when left alone, or whose landings would
replace the straight law. Then come laws that are bad on purpose: each must be refused wherever the good one is not, and
on the valves that are drawn it breaks what the good one keeps.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from positioner.control.laws.slides.certificate import Certificate, KnownValve, Refused, certified, local_factor
from positioner.control.laws.slides.slide_law import SlideSettings
from positioner.control.laws.slides.slide_pressure import Balance
from positioner.control.laws.slides.slide_states import Idle
from positioner.estimation.acceptance import Ratios
from positioner.estimation.landings.breakaway_distance import BreakawayDistance, Interval
from positioner.estimation.landings.static_law import static_law
from tests.control.scripted_stem import SETTINGS, SLOPE_PA_PER_M, STROKE_M, ScriptedStem

LONGEST, KNOWN_WITHIN, GIVES = 0.08, 1.5, 0.02
BALANCE, SCATTER = 5e-4, 2e-4
"""Of the stroke."""
FRICTION = (1.5, 3.0)
"""Of the break-away distance."""
WAVES = 40.0
"""Over the stroke, at the most."""
ALONE_S, BAD_EVERY = 600.0, 20
"""s; so many valves are tried under the bad laws, too."""
ROUNDING_M = 1e-9
THRESHOLDS = SETTINGS.thresholds
BAD_LAWS = {
    "the way back is as long as has broken loose, and no longer": replace(THRESHOLDS, return_margin=1.0),
    "the way back is shorter": replace(THRESHOLDS, return_margin=0.9),
    "a move has one slide": replace(THRESHOLDS, most_slides=1),
    "a slide that misses has not landed": replace(THRESHOLDS, missed=0.0),
}
DEAD_BAND_STAYS = replace(THRESHOLDS, widening=1.0)
"""Bad where slides land farther off than the dead band."""


@dataclass(frozen=True, slots=True)
class Wave:
    """What goes over the travel between two ends: a wave, or steps of it."""

    low: float
    high: float
    waves: float
    phase: float
    steps: bool

    @classmethod
    def drawn(cls, low: float, high: float, rng: np.random.Generator) -> "Wave":
        """Draw one; half of them reach both ends."""
        if rng.random() < 0.5:
            low, high = np.sort(rng.uniform(low, high, 2)).tolist()
        waves = float(np.exp(rng.uniform(np.log(0.1), np.log(WAVES))))
        return cls(low, high, waves, float(rng.uniform(0.0, 2.0 * np.pi)), bool(rng.random() < 0.5))

    def at(self, position_m: float) -> float:
        """Return its value at a place."""
        wave = np.sin(2.0 * np.pi * self.waves * position_m / STROKE_M + self.phase)
        share = 0.5 + 0.5 * (np.sign(wave) if self.steps else wave)
        return float(self.low + share * (self.high - self.low))


@dataclass
class DrawnInside(ScriptedStem):
    """A stem whose slides scatter within a bound, and land off the straight law by what goes over the travel."""

    off_m: tuple[Wave, ...] = ()
    """Down and up."""
    onward: Wave | None = None
    turning: Wave | None = None

    def scattered_m(self) -> float:
        ends = self.rng.random() < 0.5
        return self.scatter_m * float(self.rng.choice((-1.0, 1.0)) if ends else self.rng.uniform(-1.0, 1.0))

    def lands_m(self, command_pa: float, direction: int) -> float:
        straight_m = super().lands_m(command_pa, direction)
        return straight_m - self.off_m[direction > 0].at(straight_m)

    def needs_m(self, direction: int) -> float:
        wave = self.onward if direction == self.direction else self.turning
        return 0.0 if wave is None else wave.at(self.stuck_m)

    @property
    def ratios(self) -> Ratios:
        """The straight law."""
        return Ratios(-SLOPE_PA_PER_M, -0.5 * (self.up_pa + self.down_pa), 0.5 * (self.up_pa - self.down_pa))

    @property
    def balance(self) -> Balance:
        return Balance(
            ratios=self.ratios,
            landings=tuple(self.landings[:20]),
            held=tuple(self.held[:20]),
            stroke_m=STROKE_M,
            now_s=self.now_s,
        )


def drawn_known(rng: np.random.Generator) -> KnownValve:
    """Draw intervals of a valve."""
    onward_m = STROKE_M * float(np.exp(rng.uniform(np.log(0.01), np.log(LONGEST))))
    turning_m = onward_m + STROKE_M * float(rng.choice((0.0, 1.0)) * rng.uniform(0.0, GIVES))
    onward, turning = (
        Interval(each_m / float(rng.uniform(1.01, KNOWN_WITHIN)), each_m, seen=True) for each_m in (onward_m, turning_m)
    )
    low_m, high_m = np.sort(STROKE_M * rng.uniform(-1.0, 1.0, 2) * np.exp(rng.uniform(np.log(1e-5), np.log(BALANCE))))
    return KnownValve(
        low_m=float(low_m),
        high_m=float(high_m),
        scatter_m=STROKE_M * float(np.exp(rng.uniform(np.log(1e-6), np.log(SCATTER)))),
        onward=onward,
        turning=turning,
        friction_m=turning_m * float(rng.uniform(*FRICTION)),
    )


def drawn_inside(known: KnownValve, rng: np.random.Generator, settings: SlideSettings = SETTINGS) -> DrawnInside:
    """Draw a valve inside intervals, under a law."""
    local = local_factor(known, STROKE_M)
    friction_pa = SLOPE_PA_PER_M * known.friction_m
    preload_pa = friction_pa * float(rng.uniform(-0.2, 0.2))
    onward, turning = (
        Wave.drawn((1.0 + ROUNDING_M) * each.held_m / local, each.broke_m * local, rng)
        for each in (known.onward, known.turning)
    )
    stem = DrawnInside(
        settings,
        up_pa=friction_pa + preload_pa,
        down_pa=friction_pa - preload_pa,
        onward_m=known.onward.broke_m,
        turning_m=known.turning.broke_m,
        scatter_m=known.scatter_m,
        rng=rng,
        off_m=(Wave.drawn(known.low_m, known.high_m, rng), Wave.drawn(known.low_m, known.high_m, rng)),
        onward=onward,
        turning=turning,
    )
    distances = BreakawayDistance(known.onward, known.onward, known.turning, known.turning)
    stem.memory = replace(stem.memory, distances=distances)
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
        ended = isinstance(stem.memory.state, Idle) and stem.memory.stuck_at_m is None
        if abs(stem.position_m - to_m) > found.ends_within_m + ROUNDING_M or not ended:
            yield f"ends {1e3 * abs(stem.position_m - to_m):.3g} mm off, {1e3 * found.ends_within_m:.3g} are proved"
        left_pa = stem.memory.command_pa
        for _ in range(3):
            stem.now_s += ALONE_S
            stem.once(to_m)
        if stem.memory.command_pa != left_pa:
            yield "moves when left alone"
        if static_law(stem.landings[:20], STROKE_M).contradicts(stem.ratios, STROKE_M):
            yield "its landings replace the straight law"


def wrongly_given(known: KnownValve) -> Iterator[str]:
    """Yield the bad laws that are given a certificate on a valve."""
    for name, thresholds in BAD_LAWS.items():
        if isinstance(certified(known, replace(SETTINGS, thresholds=thresholds)), Certificate):
            yield name
    found = certified(known, replace(SETTINGS, thresholds=DEAD_BAND_STAYS))
    if isinstance(found, Certificate) and found.ends_within_m > SETTINGS.dead_band_m:
        yield "the dead band stays"


def report(valves: int, moves: int, seed: int) -> Iterator[str]:
    """Yield lines."""
    refused, bad, broken = Counter[str](), Counter[str](), Counter[str]()
    given, number, slides, left = 0, 0, [], []
    while given < valves:
        number += 1
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
        if given % BAD_EVERY == 0:
            for name, thresholds in BAD_LAWS.items():
                worse = drawn_inside(known, rng, replace(SETTINGS, thresholds=thresholds))
                broken[name] += any(True for _ in violated(worse, found, moves))
    yield f"{number} drawn: certified {given}; not proved, for want of {dict(refused)}"
    yield f"slides a step at the most: median {np.median(slides):.0f}, largest {max(slides)}"
    yield f"violated certificates: {len({each.split(':')[0] for each in left})} of {given}"
    yield from left[:10]
    yield f"bad laws that were given one: {dict(bad)}"
    yield f"bad laws that broke the certificate of the good one, of {given // BAD_EVERY} valves: {dict(broken)}"


def main() -> None:
    """Print the report."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--valves", type=int, default=10_000, help="that are certified")
    parser.add_argument("--moves", type=int, default=8)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    for line in report(arguments.valves, arguments.moves, arguments.seed):
        print(line, flush=True)


if __name__ == "__main__":
    main()

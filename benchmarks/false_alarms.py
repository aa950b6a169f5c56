"""How often the tests of the packing cry wolf, and how late they are: `python -m benchmarks.false_alarms [--days N]`.

A valve is identified once a day. Its friction, as a multiple of the baseline, is

    f(t) = 1.25 + 0.1 sin(2 pi t / 1 d) + 0.1 sin(2 pi t / 1 a) + c(t) + wear(t)

c coloured noise, first order, 0.05, of a memory of 10 days; wear up to 0.02 a year, taken back at a yearly overhaul.
The identification errs by 5 %, as it says. The limit is 1.5: f stays below it, so that every alarm is false. Twenty
moves a day are missed with a chance of 0.3 + 2 c(t), at most 0.5, its limit. Then both lie on their limits all the
time, the worst that is no fault, and the promise is one in a year, so that alarms can be counted.

Then the packing tightens at 2 % a day, from 1.25 on, and what counts is the days from f = 1.5 to the alarm; the CUSUM
beside it, of the same observations, has the threshold at which it is false no more than once in the same time.
"""

import argparse
import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from config.codes import Ne107Cause
from positioner.daemon.health.friction_alarms import TESTS, FoundFriction, FrictionAlarms, FrictionLimits
from positioner.daemon.health.stiction_index import MEMORY

LIMITS = FrictionLimits(friction_high=1.5, friction_low=0.5, stiction_limit=0.5, false_alarm_years=100.0)
COUNTABLE = replace(LIMITS, false_alarm_years=1.0)
DAY_S, YEAR = 86_400.0, 365.25
ERROR = 0.05
MOVES = 20
"""A day."""
TIGHTENS = 0.02
"""A day."""
CUSUM_SLACK = 0.5
"""Deviations."""


def coloured(days: int, rng: np.random.Generator) -> np.ndarray:
    """Return noise of a memory of ten days and a deviation of 0.05, a value a day."""
    keeps, now = math.exp(-1 / 10), 0.0
    found = np.empty(days)
    for i, kick in enumerate(0.05 * math.sqrt(1 - keeps**2) * rng.standard_normal(days)):
        now = keeps * now + kick
        found[i] = now
    return found


def friction(noise: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return friction over its baseline, a value a day, within its limit."""
    day = np.arange(noise.size)
    cycles = 0.1 * np.sin(2 * np.pi * rng.uniform(0, 1, noise.size)) + 0.1 * np.sin(2 * np.pi * day / YEAR)
    within: np.ndarray = np.minimum(1.25 + cycles + noise + 0.02 * (day % YEAR) / YEAR, LIMITS.friction_high)
    return within


def observed(truth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return what identifications find of it."""
    found: np.ndarray = truth * (1 + ERROR * rng.standard_normal(truth.size))
    return found


def indices(missed: np.ndarray) -> Iterator[float]:
    """Yield the stiction index at the end of each day, of moves missed, (days, MOVES)."""
    index, judged = 0.0, 0
    for day in missed:
        for each in day.tolist():
            judged += 1
            index += (each - index) / min(judged, MEMORY)
        yield index


def false_alarms(found: np.ndarray, missed: np.ndarray, limits: FrictionLimits) -> dict[Ne107Cause, int]:
    """Return how many alarms our tests raise, of frictions found, (days,), and moves missed, (days, MOVES)."""
    tests, before = FrictionAlarms(limits), frozenset[Ne107Cause]()
    counts = dict.fromkeys((Ne107Cause.FRICTION_HIGH, Ne107Cause.FRICTION_LOW, Ne107Cause.STICTION), 0)
    bad = np.cumsum(missed.sum(axis=1)).tolist()
    for day, (value, index) in enumerate(zip(found.tolist(), indices(missed), strict=True)):
        moves = (MOVES * (day + 1), bad[day])
        raised = tests.look(DAY_S * day, FoundFriction(value, ERROR * value), 1.0, moves, index)
        for cause in raised - before:
            counts[cause] += 1
        before = raised
    return counts


def cusum_alarms(found: np.ndarray, threshold: float) -> int:
    """Return how many a CUSUM raises that begins anew after each."""
    total, count = 0.0, 0
    for z in ((found - LIMITS.friction_high) / (ERROR * found)).tolist():
        total = max(0.0, total + z + CUSUM_SLACK)
        if total > threshold:
            total, count = 0.0, count + 1
    return count


def counted(days: int, rng: np.random.Generator) -> Iterator[str]:
    """Yield how many alarms are false in a plant's days, and in days on the limits."""
    years, noise = days / YEAR, coloured(days, rng)
    found = observed(friction(noise, rng), rng)
    chance = np.clip(0.3 + 2.0 * noise, 0.0, LIMITS.stiction_limit)
    missed = rng.uniform(size=(days, MOVES)) < chance[:, None]
    counts = false_alarms(found, missed, LIMITS)
    plain = (
        int(np.sum(found > LIMITS.friction_high)),
        int(np.sum(np.array(list(indices(missed))) > LIMITS.stiction_limit)),
    )
    promised = years / LIMITS.false_alarm_years
    yield f"{days} valve-days, {years:.0f} years: at most {promised:.1f} false alarms are promised"
    yield f"e-detector: {_said(counts)}; a plain limit: friction {plain[0]} times, stiction {plain[1]} days"
    edge = observed(np.full(days, LIMITS.friction_high), rng)
    missed = rng.uniform(size=(days, MOVES)) < LIMITS.stiction_limit
    allowed = years / COUNTABLE.false_alarm_years / TESTS
    counts = false_alarms(edge, missed, COUNTABLE)
    yield f"on the limits, one a year promised: {_said(counts)}; {allowed:.0f} each at most"


def _said(counts: dict[Ne107Cause, int]) -> str:
    return ", ".join(f"{cause.name.lower()} {count}" for cause, count in counts.items())


def delays(days: int, rng: np.random.Generator) -> Iterator[str]:
    """Yield how late a tightening packing is told, beside a CUSUM that is false as seldom."""
    found = observed(friction(coloured(days, rng), rng), rng)
    threshold = next(h for h in np.arange(1.0, 200.0, 0.5) if cusum_alarms(found, h) <= 1)
    late: dict[str, list[int]] = {"e-detector": [], "CUSUM": []}
    for _ in range(200):
        truth = 1.25 + TIGHTENS * np.arange(200)
        seen, passed = observed(truth, rng), int(np.argmax(truth > LIMITS.friction_high))
        tests, total = FrictionAlarms(LIMITS), 0.0
        done: dict[str, int] = {}
        for day, value in enumerate(seen.tolist()):
            raised = tests.look(DAY_S * day, FoundFriction(value, ERROR * value), 1.0, (0, 0), 0.0)
            total = max(0.0, total + (value - LIMITS.friction_high) / (ERROR * value) + CUSUM_SLACK)
            if Ne107Cause.FRICTION_HIGH in raised:
                done.setdefault("e-detector", day)
            if total > threshold:
                done.setdefault("CUSUM", day)
            if len(done) == len(late):
                break
        for name, day in done.items():
            late[name].append(day - passed)
    for name, days_late in late.items():
        said = f"median {np.median(days_late):.0f} days late, 90 % within {np.quantile(days_late, 0.9):.0f}"
        yield f"{name}: {said}" + (f" (threshold {threshold:g}, found on such days)" if name == "CUSUM" else "")


def main() -> None:
    """Print the counts and the delays."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=int, default=100_000, help="valve-days")
    days = parser.parse_args().days
    rng = np.random.default_rng(71)
    for line in (*counted(days, rng), *delays(days, rng)):
        print(line)


if __name__ == "__main__":
    main()

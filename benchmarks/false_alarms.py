"""How often the tests of the packing cry wolf, and how late they are: `python -m benchmarks.false_alarms [--days N]`.

A valve is identified once a day. Its friction, as a multiple of the baseline, is

    f(t) = 1.25 + 0.1 sin(2 pi t / 1 d) + 0.1 sin(2 pi t / 1 a) + c(t) + wear(t)

c coloured noise, first order, 0.05, of a memory of 10 days; wear up to 0.02 a year, taken back at a yearly overhaul.
The identification errs by 5 %, as it says. The limit is 1.5: f stays below it, so that every alarm is false. Then the
packing tightens at 2 % a day, from 1.25 on, and what counts is the days from f = 1.5 to the alarm; the CUSUM beside it,
of the same observations, has the threshold at which it is false no more than once in the same time.
"""

import argparse
import math

import numpy as np

from config.codes import Ne107Cause
from positioner.daemon.health.packing_tests import FoundFriction, PackingLimits, PackingTests

LIMITS = PackingLimits(friction_high=1.5, friction_low=0.5, stiction_limit=0.5, false_alarm_years=100.0)
DAY_S, YEAR = 86_400.0, 365.25
ERROR = 0.05
WITHIN = 1.49
"""What is drawn beyond stays here: the limit is never passed."""
TIGHTENS = 0.02
"""A day."""
CUSUM_SLACK = 0.5
"""Deviations."""


def friction(days: int, rng: np.random.Generator) -> np.ndarray:
    """Return friction over its baseline, a value a day, within its limit."""
    day = np.arange(days)
    keeps = math.exp(-1 / 10)
    coloured = np.empty(days)
    now = 0.0
    for i, kick in enumerate(0.05 * math.sqrt(1 - keeps**2) * rng.standard_normal(days)):
        now = keeps * now + kick
        coloured[i] = now
    hour = rng.uniform(0, 1, days)
    cycles = 0.1 * np.sin(2 * np.pi * hour) + 0.1 * np.sin(2 * np.pi * day / YEAR)
    within: np.ndarray = np.minimum(1.25 + cycles + coloured + 0.02 * (day % YEAR) / YEAR, WITHIN)
    return within


def observed(truth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return what identifications find of it."""
    found: np.ndarray = truth * (1 + ERROR * rng.standard_normal(truth.size))
    return found


def false_alarms(found: np.ndarray) -> int:
    """Return how many alarms our test raises."""
    tests, before, count = PackingTests(LIMITS), False, 0
    for day, value in enumerate(found.tolist()):
        raised = Ne107Cause.FRICTION_HIGH in tests.look(
            DAY_S * day, FoundFriction(value, ERROR * value), 1.0, (0, 0), 0.0
        )
        count += raised and not before
        before = raised
    return count


def cusum_alarms(found: np.ndarray, threshold: float) -> int:
    """Return how many a CUSUM raises that begins anew after each."""
    total, count = 0.0, 0
    for z in ((found - LIMITS.friction_high) / (ERROR * found)).tolist():
        total = max(0.0, total + z + CUSUM_SLACK)
        if total > threshold:
            total, count = 0.0, count + 1
    return count


def main() -> None:
    """Print the counts and the delays."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--days", type=int, default=100_000, help="valve-days")
    days = parser.parse_args().days
    rng = np.random.default_rng(71)
    found = observed(friction(days, rng), rng)
    years = days / YEAR
    allowed = years / LIMITS.false_alarm_years
    count = false_alarms(found)
    plain = int(np.sum(found > LIMITS.friction_high))
    print(f"{days} valve-days, {years:.0f} years: at most {allowed:.1f} false alarms are promised")
    print(f"e-detector: {count} false alarms; each identification beyond the limit by itself: {plain}")
    threshold = next(h for h in np.arange(1.0, 200.0, 0.5) if cusum_alarms(found, h) <= max(count, 1))
    late: dict[str, list[int]] = {"e-detector": [], "CUSUM": []}
    for _ in range(200):
        truth = 1.25 + TIGHTENS * np.arange(200)
        seen, passed = observed(truth, rng), int(np.argmax(truth > LIMITS.friction_high))
        tests, total = PackingTests(LIMITS), 0.0
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
    for name, delays in late.items():
        said = f"median {np.median(delays):.0f} days late, 90 % within {np.quantile(delays, 0.9):.0f}"
        print(f"{name}: {said}" + (f" (threshold {threshold:g}, found on these very days)" if name == "CUSUM" else ""))


if __name__ == "__main__":
    main()

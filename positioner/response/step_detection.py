"""The steps of an input: changes from one held value to another, quick against the hold that follows.

An input is held while it stays within its own noise, 6 robust standard deviations of the differences of neighbours
(0 for an input that a computer wrote). A ramp or a sine holds nothing and has no steps.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from config.recording import Column

FEWEST_HELD = 5
"""Samples that a hold needs, before a step and after it."""
QUICK = 0.05
"""A change takes at most this part of the hold that follows."""


@dataclass(frozen=True, slots=True)
class StepChange:
    """Samples [before, first) hold `from_`, [first, end) begin with the change and hold `to`."""

    before: int
    first: int
    end: int
    from_: float
    to: float

    @property
    def size(self) -> float:
        """Change of the input, signed."""
        return self.to - self.from_


def find_steps(time_s: Column, held: Column) -> list[StepChange]:
    """Return the steps of an input in order of time; time (n,), s, and input (n,), in any unit.

    >>> held = np.repeat([0.02, 0.05, 0.04], 100)
    >>> [(step.first, round(step.size, 3)) for step in find_steps(np.arange(300) * 0.01, held)]
    [(100, 0.03), (200, -0.01)]
    """
    if len(held) < 2 * FEWEST_HELD:
        return []
    tolerance = _tolerance(held)
    holds = [(a, b) for a, b in _runs(held, tolerance) if b - a >= FEWEST_HELD and np.ptp(held[a:b]) <= 2 * tolerance]
    steps = []
    for (a, b), (c, d) in pairwise(holds):
        before, after = float(np.median(held[a:b])), float(np.median(held[c:d]))
        quick = time_s[c] - time_s[b] <= QUICK * (time_s[d - 1] - time_s[c])
        if quick and abs(after - before) > tolerance:
            steps.append(StepChange(a, b, d, before, after))
    return steps


def _tolerance(held: Column) -> float:
    noise = 1.4826 * float(np.median(np.abs(np.diff(held)))) / 2**0.5
    return 6 * noise + 1e-9 * float(np.ptp(held))


def _runs(held: Column, tolerance: float) -> list[tuple[int, int]]:
    """Return where the input does not jump: pairs of first index and the one past the last."""
    jumps = np.flatnonzero(np.abs(np.diff(held)) > tolerance) + 1
    edges = [0, *jumps.tolist(), len(held)]
    return list(pairwise(edges))
